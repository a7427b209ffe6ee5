"""A quota of processor time counts as cores, as an affinity does."""

import os
import subprocess
import sys
from collections.abc import Callable, Generator
from pathlib import Path

import pytest

from monochord.core import cores
from monochord.core.cores import available_cores

Quota = Callable[[str, str, str], None]
COUNT = "from monochord.core.cores import available_cores; print(available_cores())"


@pytest.fixture(autouse=True)
def _eight_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _pid: set(range(8)))


@pytest.fixture
def group(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Quota:
    """Return what makes this process a member of a made-up control group with files of these contents."""

    def make(membership: str, files: str, contents: str) -> None:
        (tmp_path / "membership").write_text(f"3:memory:/\n{membership}\n")
        for file, content in zip(files.split(), contents.split(";"), strict=True):
            (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / file).write_text(f"{content}\n")

    monkeypatch.setattr(cores, "GROUPS", tmp_path)
    monkeypatch.setattr(cores, "PROCESS_GROUPS", tmp_path / "membership")
    return make


@pytest.mark.parametrize(
    ("membership", "files", "contents", "count"),
    [
        ("0::/", "cpu.max", "200000 100000", 2),
        ("0::/", "cpu.max", "150000 100000", 2),
        ("0::/", "cpu.max", "10000 100000", 1),
        ("0::/", "cpu.max", "max 100000", 8),
        ("0::/job/step", "cpu.max job/cpu.max job/step/cpu.max", "max 100000;300000 100000;max 100000", 3),
        ("0::/job/step", "job/cpu.max job/step/cpu.max", "300000 100000;100000 50000", 2),
        ("4:cpu:/job", "cpu/job/cpu.cfs_quota_us cpu/job/cpu.cfs_period_us", "400000;100000", 4),
        ("4:cpu,cpuacct:/", "cpu,cpuacct/cpu.cfs_quota_us cpu,cpuacct/cpu.cfs_period_us", "-1;100000", 8),
        ("0::/", "cpu.max", "strange", 8),
        ("0::/gone", "cpu.max", "9900000 100000", 8),
    ],
)
def test_a_quota_is_a_number_of_cores(
    group: Quota, membership: str, files: str, contents: str, count: int
) -> None:
    group(membership, files, contents)
    assert available_cores() == count


def test_without_control_groups_the_affinity_counts(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(cores, "PROCESS_GROUPS", tmp_path / "none")
    assert available_cores() == 8


@pytest.fixture
def real_group() -> Generator[Path]:
    """A control group of this machine with a quota of one core."""
    home = next(
        (each for each in (Path("/sys/fs/cgroup/cpu"), Path("/sys/fs/cgroup")) if each.is_dir()), None
    )
    if home is None:
        pytest.skip("control groups are not mounted")
    own = home / f"monochord-test-{os.getpid()}"
    try:
        own.mkdir()
        if (own / "cpu.max").exists():
            (own / "cpu.max").write_text("100000 100000")
        else:
            (own / "cpu.cfs_quota_us").write_text("100000")
    except OSError as error:
        if own.exists():
            own.rmdir()
        pytest.skip(f"no control group with a quota can be made here: {error.strerror}")
    yield own
    own.rmdir()


def test_a_process_in_a_real_group_has_the_cores_of_its_quota(real_group: Path) -> None:
    join = f"import os; open('{real_group}/cgroup.procs', 'w').write(str(os.getpid())); "
    assert subprocess.check_output([sys.executable, "-c", join + COUNT], text=True) == "1\n"
