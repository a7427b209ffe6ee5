import os
import resource
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.capture.instruments.pose_csv import PoseCsv
from monochord.core.errors import InputError
from monochord.core.types import Floats


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "pose.csv"
    path.write_text("time,x,y,z\n0.5,9,9,9\n")
    return path


def append(file: Path, text: str) -> None:
    with file.open("a") as writer:
        writer.write(text)


def test_what_is_appended_is_read_line_by_complete_line(file: Path) -> None:
    with PoseCsv(path=str(file)).open() as connection:
        assert connection.poll() == []
        append(file, "1.0,0.1,0.2,0.3\n1.5,0.4,0.5")
        (got,) = connection.poll()
        assert got.values.tolist() == [[0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0]]
        assert got.device_time.tolist() == [1_000_000_000]
        append(file, ",0.6\n")
        (got,) = connection.poll()
        assert got.values[0, :3].tolist() == [0.4, 0.5, 0.6]
        assert connection.health.readings == 2
        assert connection.health.faulty == 0


def test_a_line_that_was_begun_before_the_opening_is_read_once_complete(file: Path) -> None:
    append(file, "1.0,0.1,")
    with PoseCsv(path=str(file)).open() as connection:
        assert connection.poll() == []
        append(file, "0.2,0.3\n")
        (got,) = connection.poll()
        assert got.values[0, :3].tolist() == [0.1, 0.2, 0.3]
        assert connection.health.faulty == 0


def test_columns_are_read_by_name_with_the_orientation(tmp_path: Path) -> None:
    path = tmp_path / "pose.csv"
    path.write_bytes(b"\xef\xbb\xbfmode, QW, qx,qy,qz, z,y,x,time\r\nauto,0.8,0,0,0.6,3,2,1,7\r\n")
    with PoseCsv(path=str(path), from_start=True).open() as connection:
        (got,) = connection.poll()
    assert np.allclose(got.values, [[1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8]])


def test_a_line_that_is_no_pose_is_counted(file: Path) -> None:
    with PoseCsv(path=str(file)).open() as connection:
        append(file, "1,2,3\n1,2,3,4,5\n1,nan,0,0\n\n1,x,0,0\n1e99,0,0,0\n2,0,0,0\n1,0,0,0\n")
        (got,) = connection.poll()
        assert got.time.size == 2
        assert connection.health.faulty == 5
        assert connection.health.out_of_order == 1


def test_a_pose_that_is_absurd_is_counted(file: Path) -> None:
    with PoseCsv(path=str(file)).open() as connection:
        append(file, "1,1e308,0,0\n1,-1e8,0,0\n1,inf,0,0\n1,412,0,0\n1,0,nan,0\n1,-9.9,0,0\n")
        (got,) = connection.poll()
        assert got.values[:, 0].tolist() == [-9.9]
        assert connection.health.faulty == 5


def turned(path: Path, head: str, row: str, **options: Any) -> Floats:
    """Return the matrix (3, 3) of the orientation of a file's only pose, and check its place."""
    path.write_text(f"time,x,y,z,{head}\n1.0,0.1,0.2,0.3,{row}\n")
    with PoseCsv(path=str(path), from_start=True, **options).open() as connection:
        (got,) = connection.poll()
    assert got.values[0, :3].tolist() == [0.1, 0.2, 0.3]
    x, y, z, w = got.values[0, 3:]
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * w * across + 2.0 * across @ across


def about(axis: int, angle: float) -> Floats:
    """Return the matrix (3, 3) of a turn about x, y or z."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = np.cos(angle)
    matrix[second, first] = np.sin(angle)
    matrix[first, second] = -matrix[second, first]
    return matrix


A, B, C = 0.5, -1.1, 2.3
ROW = f"{A},{B},{C}"


@pytest.mark.parametrize("head", ["rx,ry,rz", "roll,pitch,yaw"])
def test_angles_are_read_as_the_option_says(file: Path, head: str) -> None:
    x, y, z = about(0, A), about(1, B), about(2, C)
    assert turned(file, head, ROW, rotation="fixed_xyz") == pytest.approx(z @ y @ x)
    assert turned(file, head, ROW, rotation="moving_xyz") == pytest.approx(x @ y @ z)
    degrees = ",".join(str(np.degrees(angle)) for angle in (A, B, C))
    assert turned(file, head, degrees, rotation="fixed_xyz", angles="deg") == pytest.approx(z @ y @ x)
    assert turned(file, head, ROW, rotation="none") == pytest.approx(np.eye(3))
    given = turned(file, f"{head},qx,qy,qz,qw", f"{ROW},1,0,0,0", rotation="vector")
    assert given == pytest.approx(np.diag([1.0, -1.0, -1.0]))  # a quaternion needs no explanation


def test_a_rotation_vector_is_an_axis_times_an_angle(file: Path) -> None:
    """Its series is the exponential of the vector's cross product."""
    across = np.array([[0.0, -C, B], [C, 0.0, -A], [-B, A, 0.0]])
    exponential, term = np.eye(3), np.eye(3)
    for order in range(1, 30):
        term = term @ across / order
        exponential += term
    assert turned(file, "rx,ry,rz", ROW, rotation="vector") == pytest.approx(exponential)
    assert turned(file, "rx,ry,rz", "0,0,0", rotation="vector") == pytest.approx(np.eye(3))


def test_millimetres_are_read_where_the_option_says_so(file: Path) -> None:
    file.write_text("time,x,y,z\n1,412,-250,30\n")
    with PoseCsv(path=str(file), from_start=True, unit="mm").open() as connection:
        (got,) = connection.poll()
        assert got.values[0, :3].tolist() == pytest.approx([0.412, -0.25, 0.03])


@pytest.mark.parametrize(
    ("text", "options", "remedy"),
    [
        ("time,x,y,z\n1,412,-250,30\n", {}, "unit=mm"),
        ("time,x,y,z\n1,4,0,0\n", {"reach": 2.0}, "reach="),
        ("time,x,y,z,rx,ry,rz\n1,0,0,0,1,0,0\n", {}, "rotation="),
        ("time,x,y,z,roll,pitch,yaw\n", {}, "rotation="),
        ("time,x,y,z,rx,ry,rz\n1,0,0,0,90,0,0\n", {"rotation": "fixed_xyz"}, "angles=deg"),
        ("time,x,y,z,rx,ry\n", {"rotation": "vector"}, "rz"),
        ("time,x,y,z,qx,qy,qz\n", {}, "qw"),
    ],
)
def test_what_may_mean_another_thing_is_refused(
    file: Path, text: str, options: dict[str, Any], remedy: str
) -> None:
    file.write_text(text)
    for from_start in (False, True):
        reader = PoseCsv(path=str(file), from_start=from_start, **options)
        with pytest.raises(InputError, match=remedy), reader.open():
            pass


def test_lines_in_other_units_that_come_later_are_counted(file: Path) -> None:
    file.write_text("time,x,y,z,rx,ry,rz\n")
    with PoseCsv(path=str(file), rotation="fixed_xyz").open() as connection:
        append(file, "1,412,0,0,0,0,0\n1,0,0,0,90,0,0\n1,0,0,0,1,0,0\n")
        (got,) = connection.poll()
        assert len(got.values) == 1
        assert connection.health.faulty == 2


def test_a_line_without_an_end_is_counted_once_and_dropped(file: Path) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with PoseCsv(path=str(file)).open() as connection:
        with file.open("ab") as writer:
            for _ in range(40):
                writer.write(bytes(1 << 20))
                writer.flush()
                assert connection.poll() == []
        append(file, "9\n" + "2" * 5000 + ",0,0,0\n1,2,3,4\n")
        (got,) = connection.poll()
        assert got.values[:, 0].tolist() == [2.0]
        assert connection.health.faulty == 2
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 16 << 10  # KiB


def test_a_first_line_without_an_end_is_refused() -> None:
    with pytest.raises(InputError, match="/dev/zero"), PoseCsv(path="/dev/zero").open():
        pass


def test_a_pipe_is_read_as_its_lines_come_and_never_waited_for(tmp_path: Path) -> None:
    path = tmp_path / "pose.fifo"
    os.mkfifo(path)
    with PoseCsv(path=str(path)).open() as connection:  # nobody writes to it
        assert connection.poll() == []
        with path.open("wb", buffering=0) as writer:
            writer.write(b"time,x,y,z\n1,2,3,")
            assert connection.poll() == []
            writer.write(b"4\n")
            (got,) = connection.poll()
            assert connection.poll() == []
            for _ in range(4):
                writer.write(bytes(60_000))
                assert connection.poll() == []
            writer.write(b"\n2,3,4,5\n")
        (more,) = connection.poll()
        assert connection.poll() == []
        assert connection.health.faulty == 1
        assert connection.health.reconnects == 0
    assert [*got.values[:, 0], *more.values[:, 0]] == [2.0, 3.0]


@pytest.mark.parametrize("replace", [False, True])
def test_a_file_that_is_written_anew_is_read_from_its_top(file: Path, *, replace: bool) -> None:
    with PoseCsv(path=str(file)).open() as connection:
        if replace:
            file.rename(file.with_suffix(".old"))
        file.write_text("time,z,y,x\n")
        append(file, "1,3,2,1\n")
        (got,) = connection.poll()
        assert got.values[0, :3].tolist() == [1.0, 2.0, 3.0]
        assert connection.health.reconnects == 1
        file.unlink()
        assert connection.poll() == []


def test_a_file_without_its_columns_is_refused(file: Path) -> None:
    file.write_text("time,x,y\n")
    with pytest.raises(InputError, match="z"), PoseCsv(path=str(file)).open():
        pass


def opened(file: Path, head: str, row: str, **options: Any) -> Floats:
    file.write_text(f"{head}\n{row}\n")
    with PoseCsv(path=str(file), from_start=True, **options).open() as connection:
        (got,) = connection.poll()
    return got.values[0]


@pytest.mark.parametrize(
    ("names", "first"),
    [
        ("a,b,c", "moving_zyx"),
        ("A,B,C", "moving_zyx"),
        ("tcp_a,tcp_b,tcp_c", "moving_zyx"),
        ("A [deg],B [deg],C [deg]", "moving_zyx"),
        ("u,v,w", "moving_zyx"),
        ("w,p,r", "fixed_xyz"),
        ("o,a,t", "moving_zyz"),
        ("e1,e2,e3", "moving_zyz"),
        ("phi,theta,psi", "fixed_xyz"),
        ("rx,ry,rz", "vector"),
        ("tcp_rx,tcp_ry,tcp_rz", "vector"),
        ("RotX,RotY,RotZ", "vector"),
        ("euler_x,euler_y,euler_z", "vector"),
        ("ex,ey,ez", "vector"),
        ("orientation.x,orientation.y,orientation.z", "vector"),
        ("yaw,pitch,roll", "fixed_xyz"),
        ("roll_deg,pitch_deg,yaw_deg", "fixed_xyz"),
        ("q1,q2,q3,q4", "wxyz"),
        ("q0,q1,q2,q3", "wxyz"),
        ("quat_x,quat_y,quat_z,quat_w", "xyzw"),
        ("orientation_w,orientation_x,orientation_y,orientation_z", "xyzw"),
    ],
)
def test_what_looks_like_a_rotation_is_refused_with_the_value_that_reads_it(
    file: Path, names: str, first: str
) -> None:
    head, count = f"time,x,y,z,{names}", names.count(",") + 1
    row = ",".join(["1,0,0,0", *(["0.5"] * count)])
    with pytest.raises(InputError, match=rf"ambiguous.*{first}.*rotation={first}") as refused:
        opened(file, head, row)
    if count == 3:
        assert "moving_zyx (about z, the rotated y, the rotated x" in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1
    turned = opened(file, head, row, rotation=first)
    assert 0.1 < abs(turned[6]) < 0.95
    assert opened(file, head, row, rotation="none")[3:].tolist() == [0.0, 0.0, 0.0, 1.0]


@pytest.mark.parametrize(
    "names", ["rx,ry", "yaw", "heading", "a,b,c,rx,ry,rz", "r11,r12,r13,r21,r22,r23,r31,r32,r33"]
)
@pytest.mark.parametrize("rotation", ["", "vector"])
def test_a_rotation_that_no_value_reads_is_refused(file: Path, names: str, rotation: str) -> None:
    row = ",".join(["1,0,0,0", *(["0.5"] * (names.count(",") + 1))])
    with pytest.raises(InputError, match="rotation=none"):
        opened(file, f"time,x,y,z,{names}", row, rotation=rotation)
    assert opened(file, f"time,x,y,z,{names}", row, rotation="none")[6] == 1.0


def test_the_orders_of_angles_are_those_of_the_makers(file: Path) -> None:
    degrees = ",".join(str(np.degrees(angle)) for angle in (A, B, C))
    kuka = about(2, A) @ about(1, B) @ about(0, C)
    assert turned(file, "a,b,c", degrees, rotation="moving_zyx", angles="deg") == pytest.approx(kuka)
    named = ",".join(str(np.degrees(angle)) for angle in (C, A, B))
    assert turned(file, "C,A,B", named, rotation="moving_zyx", angles="deg") == pytest.approx(kuka)
    kawasaki = about(2, A) @ about(1, B) @ about(2, C)
    assert turned(file, "o,a,t", ROW, rotation="moving_zyz") == pytest.approx(kawasaki)
    fanuc = about(2, C) @ about(1, B) @ about(0, A)
    assert turned(file, "w,p,r", ROW, rotation="fixed_xyz") == pytest.approx(fanuc)
    by_axis = about(2, C) @ about(1, B) @ about(0, A)  # the angle about z is the one that is called so
    assert turned(file, "rx,ry,rz", ROW, rotation="moving_zyx") == pytest.approx(by_axis)
    half = "0.9238795325112867,0,0,0.3826834323650898"
    assert turned(file, "q1,q2,q3,q4", half, rotation="wxyz") == pytest.approx(about(2, np.pi / 4))
    assert turned(file, "quat_w,quat_x,quat_y,quat_z", half, rotation="xyzw") == pytest.approx(
        about(2, np.pi / 4)
    )


def test_a_rotation_that_the_file_lacks_is_refused(file: Path) -> None:
    with pytest.raises(InputError, match="rotation=vector"):
        opened(file, "time,x,y,z,mode", "1,0,0,0,auto", rotation="vector")


@pytest.mark.parametrize(
    "names",
    ["mode", "vx,vy,vz", "fx,fy,fz", "q1,q2,q3,q4,q5,q6", "a1,a2,a3,a4,a5,a6", "joint_1", "a,b", "error_x"],
)
def test_other_columns_are_named_as_unread(file: Path, names: str, caplog: pytest.LogCaptureFixture) -> None:
    row = ",".join(["1,0,0,0", *(["0.5"] * (names.count(",") + 1))])
    assert opened(file, f"time,x,y,z,{names}", row)[6] == 1.0
    (line,) = caplog.messages
    assert line.endswith(f"not read: {', '.join(names.split(','))}")


def test_angles_of_a_file_that_comes_later_are_not_read_as_upright(
    file: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file.write_text("")
    with PoseCsv(path=str(file)).open() as connection:
        append(file, "time,x,y,z,a,b,c\n1,0,0,0,0.1,0.2,0.3\n")
        assert connection.poll() == []
        assert connection.health.faulty == 1
    assert "rotation=moving_zyx" in caplog.messages[0]
