import json
import os
import re
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Generator
from importlib import import_module
from pathlib import Path
from typing import Any

import psutil
import pytest

from monochord.core.errors import DeviceError, InputError
from monochord.lab import fleet
from monochord.lab.fleet import run_all

JOBS = """
    import os
    import signal
    import time
    from pathlib import Path

    import numpy as np

    from monochord.core.errors import InputError


    def noise(seed):
        return np.random.default_rng(seed).standard_normal(1000) @ np.ones(1000)


    def first_time_killed(job):
        folder, number = job
        with (Path(folder) / f"begun {number}").open("a") as file:
            file.write("x")
        if number == 3 and not (Path(folder) / "died").exists():
            (Path(folder) / "died").touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return number**2


    def killed(job):
        os.kill(os.getpid(), signal.SIGKILL)


    def refused(job):
        raise InputError(f"job {job}", "job 0", "leave it out")


    def surroundings(job):
        time.sleep(0.2)
        return os.getpid(), [os.environ.get(f"{name}_NUM_THREADS") for name in ("OPENBLAS", "NUMBA")]


    def asleep(folder):
        (Path(folder) / str(os.getpid())).touch()
        time.sleep(60)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Generator[Path]:
    """A folder that this process and its workers can import the module `fleet_jobs` from."""
    place = tmp_path_factory.mktemp("importable")
    (place / "fleet_jobs.py").write_text(textwrap.dedent(JOBS))
    sys.path.insert(0, str(place))
    yield place
    sys.path.remove(str(place))
    sys.modules.pop("fleet_jobs", None)


@pytest.fixture
def job(folder: Path) -> Callable[[str], Callable[[Any], Any]]:
    return lambda name: getattr(import_module("fleet_jobs"), name)


@pytest.fixture(params=["dask", "plain"])
def kind(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Both ways of running on this machine: with dask and, as if it were not installed, without."""
    monkeypatch.setattr(fleet, "_has_dask", lambda: request.param == "dask")
    return request.param


Find = Callable[[str], Callable[[Any], Any]]


@pytest.mark.usefixtures("kind")
def test_two_workers_make_what_one_makes(job: Find) -> None:
    one = list(run_all(range(8), job("noise"), workers=1))
    assert [number for number, _ in one] == list(range(8))
    assert sorted(run_all(range(8), job("noise"), workers=2)) == one


@pytest.mark.usefixtures("kind")
def test_a_killed_worker_loses_nothing_and_duplicates_nothing(job: Find, tmp_path: Path) -> None:
    jobs = [(str(tmp_path), number) for number in range(8)]
    done = list(run_all(jobs, job("first_time_killed"), workers=2))
    assert sorted(done) == [(each, each[1] ** 2) for each in jobs]
    assert (tmp_path / "died").exists()
    assert (tmp_path / "begun 3").read_text() == "xx"


@pytest.mark.usefixtures("kind")
def test_a_job_that_always_kills_its_worker_is_given_up_in_one_line(job: Find) -> None:
    with pytest.raises(DeviceError, match=r"a job ended its worker 3 times"):
        list(run_all(range(3), job("killed"), workers=2))


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.usefixtures("kind")
def test_what_a_job_refuses_comes_home_as_it_was(job: Find, workers: int) -> None:
    with pytest.raises(InputError, match=r"^job 1: allowed is job 0; leave it out$"):
        list(run_all([1, 1], job("refused"), workers=workers))


@pytest.mark.usefixtures("kind")
def test_workers_are_other_processes_of_one_thread_and_the_environment_is_restored(job: Find) -> None:
    before = dict(os.environ)
    found = dict(run_all(range(6), job("surroundings"), workers=2))
    assert dict(os.environ) == before
    assert len({pid for pid, _ in found.values()} - {os.getpid()}) == 2
    assert all(threads == ["1", "1"] for _, threads in found.values())


@pytest.mark.usefixtures("kind")
def test_closing_early_ends_every_worker_and_listens_on_loopback_alone(job: Find) -> None:
    running = run_all(range(50), job("surroundings"), workers=2)
    next(running)
    me = psutil.Process()
    family = [me, *me.children(recursive=True)]
    ports = [place for each in family for place in each.net_connections("inet") if place.status == "LISTEN"]
    assert {place.laddr.ip for place in ports} <= {"127.0.0.1"}
    running.close()  # pyright: ignore[reportAttributeAccessIssue]
    assert not [child for child in me.children(recursive=True) if "spawn_main" in " ".join(child.cmdline())]


@pytest.mark.usefixtures("kind")
def test_two_fleets_at_once_do_not_meet(job: Find) -> None:
    first = run_all(range(20), job("surroundings"), workers=2)
    next(first)
    assert len(list(run_all(range(4), job("noise"), workers=2))) == 4
    assert len(list(first)) == 19


def test_no_jobs_and_one_job_start_no_process(job: Find) -> None:
    assert list(run_all([], job("surroundings"))) == []
    ((_, (pid, _)),) = run_all(["one"], job("surroundings"))
    assert pid == os.getpid()


def test_fewer_than_one_worker_is_refused() -> None:
    with pytest.raises(InputError, match=r"^0 workers: allowed is 1 or more"):
        run_all([1, 2], float, workers=0)


def test_a_cluster_without_dask_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet, "_has_dask", lambda: False)
    with pytest.raises(InputError, match=r"dask is not installed.*pip install 'monochord\[cluster\]'"):
        run_all([1, 2], float, cluster="tcp://127.0.0.1:8786")


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "not an address"])
def test_an_address_where_nothing_answers_is_refused(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from monochord.lab import _dask_fleet

    monkeypatch.setattr(_dask_fleet, "ANSWER_WITHIN", 0.5)
    with pytest.raises(InputError, match=rf"cluster {address} \(no dask scheduler answers there\)"):
        list(run_all([1, 2], float, cluster=address))


@pytest.fixture
def scheduler(folder: Path, tmp_path: Path, request: pytest.FixtureRequest) -> Generator[str]:
    """Address of a real scheduler with two workers, each a program of its own, as on other machines.

    Parametrised with "another", the Monochord that the workers import is another one.
    """
    place = folder
    if getattr(request, "param", "") == "another":
        place = tmp_path
        (tmp_path / "monochord").mkdir()
        (tmp_path / "monochord" / "__init__.py").touch()
    environment = {**os.environ, "PYTHONPATH": str(place)}
    dask = [str(Path(sys.executable).with_name("dask"))]
    quiet: Any = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
    loopback = ["--host", "127.0.0.1", "--no-dashboard"]
    place = tmp_path / "scheduler.json"
    about = ["--scheduler-file", str(place)]
    started = [subprocess.Popen([*dask, "scheduler", *loopback, "--port", "0", *about], **quiet)]
    try:
        worker = [*dask, "worker", *about, "--host", "127.0.0.1", "--no-dashboard", "--nthreads", "1"]
        started += [
            subprocess.Popen([*worker, "--local-directory", str(tmp_path)], **quiet) for _ in range(2)
        ]
        deadline = time.monotonic() + 30.0
        while not place.exists():
            assert time.monotonic() < deadline
            time.sleep(0.05)
        time.sleep(0.1)
        yield json.loads(place.read_text())["address"]
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait(20)


@pytest.mark.slow
def test_a_cluster_by_its_address_does_the_same(job: Find, scheduler: str, tmp_path: Path) -> None:
    assert sorted(run_all(range(4), job("noise"), cluster=scheduler)) == list(
        run_all(range(4), job("noise"), workers=1)
    )
    jobs = [(str(tmp_path), number) for number in range(6)]
    done = list(run_all(jobs, job("first_time_killed"), cluster=scheduler))
    assert sorted(done) == [(each, each[1] ** 2) for each in jobs]
    with pytest.raises(InputError, match=r"^job 1: allowed is job 0; leave it out$"):
        list(run_all([1], job("refused"), cluster=scheduler))


@pytest.mark.slow
@pytest.mark.parametrize("scheduler", ["another"], indirect=True)
def test_a_cluster_with_other_code_is_told_in_one_line(job: Find, scheduler: str) -> None:
    with pytest.raises(DeviceError, match=r"^a worker cannot read its job \(No module named 'monochord\.lab"):
        list(run_all([1, 2], job("noise"), cluster=scheduler))


@pytest.mark.parametrize("dask", [True, False])
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_the_workers_end_with_the_program(folder: Path, tmp_path: Path, end: int, *, dask: bool) -> None:
    script = tmp_path / "program.py"
    script.write_text(
        textwrap.dedent(f"""
        import sys
        sys.path.insert(0, {str(folder)!r})
        import fleet_jobs
        from monochord.lab import fleet
        fleet._has_dask = lambda: {dask}
        if __name__ == "__main__":
            list(fleet.run_all([{str(tmp_path)!r}] * 4, fleet_jobs.asleep, workers=2))
        """)
    )
    program = subprocess.Popen(
        [sys.executable, str(script)], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    deadline = time.monotonic() + 30.0
    while len(busy := [int(path.name) for path in tmp_path.iterdir() if path.name.isdigit()]) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    if end == signal.SIGINT:
        os.killpg(program.pid, end)  # as a terminal sends it: to the workers too
    else:
        program.kill()
    _, errors = program.communicate(timeout=20)
    until = time.monotonic() + 5.0
    while any(map(psutil.pid_exists, busy)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(map(psutil.pid_exists, busy))
    if end == signal.SIGINT:
        assert len(re.findall("^Traceback", errors, re.MULTILINE)) <= 1, errors
        assert errors.strip().endswith("KeyboardInterrupt")
