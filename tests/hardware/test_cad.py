"""The parts themselves, with the CAD library: closed meshes, no overlap, clearances, STEP read back."""

import json
from pathlib import Path

import pytest

pytest.importorskip("build123d", reason="the extra cad is not installed: pip install '.[cad]' (about 1 GB)")
pytest.importorskip("trimesh", reason="the extra cad is not installed: pip install '.[cad]' (about 1 GB)")

from hardware.cad import __main__ as command
from hardware.cad import assembly, checks, shapes
from hardware.cad.build import build
from hardware.cad.layout import Layout
from hardware.cad.parameters import load_hardware
from tests.hardware.test_parameters import CASE, FOLDER, MEASURED

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(1200),
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),  # of the CAD library's own imports
]


def test_three_sensors_are_built_and_good_in_one_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = str(FOLDER / "sensor_300.toml")
    assert command.main(["prototype", "long", own, "--out", str(tmp_path), "--no-pictures"]) == 0
    assert "15 of 15 meshes closed and right, 0 overlaps" in capsys.readouterr().out
    volumes: dict[str, dict[str, float]] = {}
    for name in ("prototype", "long", "sensor_300"):
        report = json.loads((tmp_path / name / "report.json").read_text(encoding="utf-8"))
        assert report["good"]
        assert all(each["watertight"] for each in report["meshes"])
        assert report["overlaps"] == {}
        assert report["step_difference"] < 1e-9
        assert min(each["distance"] - each["least"] for each in report["clearances"]) > -1e-3
        volumes[name] = {each["name"]: each["volume"] for each in report["meshes"]}
        assert len(list((tmp_path / name).glob("*.step"))) == 17
    differing = {
        part for part, volume in volumes["prototype"].items() if abs(volumes["long"][part] - volume) > 1.0
    }
    assert {"bar", "bobbin", "carrier_1", "tuner_support", "anchor", "gauge_places_1"} <= differing
    assert not differing & {"foot", "gripper_adapter", "microphone_clamp", "gauge_fits"}


@pytest.mark.parametrize(
    ("name", "driver", "given"),
    [
        ("prototype_ebow", "ebow", CASE),
        ("prototype_ebow", "coil", {}),
        ("long", "ebow", MEASURED),
        ("prototype", "coil", {"piezo_diameter": 27.0}),
    ],
)
def test_measured_dimensions_make_parts_that_fit(
    name: str, driver: str, given: dict[str, float], tmp_path: Path
) -> None:
    report = build(load_hardware(name, driver, **given), tmp_path, pictures=False)
    assert report.good, (report.overlaps, [each for each in report.clearances if not each.kept])
    assert ("cradle_1" in {each.name for each in report.meshes}) == (driver == "ebow")
    assert "bench" in {each.second for each in report.clearances}  # it stands on feet


def test_a_build_that_does_not_fit_says_what(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["prototype", "--no-pictures", "--out", str(tmp_path), "--set"]
    assert command.main([*arguments, "shelf_thickness=40"]) == 1
    assert "bar and tuner_support share" in capsys.readouterr().err
    assert command.main([*arguments, "foot_height=8"]) == 1
    assert "bench: " in capsys.readouterr().err
    for impossible in ("bar_width=7", "fit=nan", "bobbin_height=400"):
        assert command.main([*arguments, impossible]) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_a_hole_that_misses_its_screw_is_an_overlap(monkeypatch: pytest.MonkeyPatch) -> None:
    layout = Layout(load_hardware("prototype"))
    parts = assembly.made(layout)
    assert checks.overlaps(assembly.assembled(layout, parts)) == {}
    moved_screws = tuple((x, y + 1.0) for x, y in layout.block_screws)
    monkeypatch.setitem(layout.__dict__, "block_screws", moved_screws)
    moved = checks.overlaps(assembly.assembled(layout, parts))
    assert any("screw_block" in " ".join(pair) for pair in moved)


def test_overlap_has_its_volume_and_touching_is_none() -> None:
    one = shapes.block((0, 10), (0, 10), (0, 10))
    for start, volume in ((9.0, 100.0), (10.0, 0.0), (11.0, 0.0)):
        found = checks.overlaps({"one": one, "two": shapes.block((start, 20), (0, 10), (0, 10))})
        assert sum(found.values()) == pytest.approx(volume)


def test_a_nut_slides_into_its_slot() -> None:
    size = shapes.nut_pocket(shapes.M4, (0, 3)).bounding_box().size
    assert pytest.approx(shapes.M4["nut"]) == size.X  # as wide as the slot, its corners along it
    assert pytest.approx(shapes.M4["nut"] * 2 / 3**0.5) == size.Y


@pytest.mark.parametrize(
    ("name", "driver", "given", "folder"),
    [("prototype", "coil", {}, "pictures"), ("prototype_ebow", "ebow", CASE, "pictures/prototype_ebow")],
)
def test_pictures_are_drawn(
    name: str, driver: str, given: dict[str, float], folder: str, tmp_path: Path
) -> None:
    build(load_hardware(name, driver, **given), tmp_path)
    drawn = {each.stem: each.stat().st_size for each in tmp_path.glob("*.svg")}
    used = {each.stem for each in (FOLDER / folder).glob("*.svg")}
    assert used
    assert used <= drawn.keys()
    assert min(drawn.values()) > 1000
