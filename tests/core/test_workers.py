import json
import os
import re
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Generator
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from pathlib import Path
from typing import Any

import psutil
import pytest
from tests.waiting import wait_for

from monochord.core import workers
from monochord.core.errors import DeviceError, InputError
from monochord.core.workers import Spread, Worker, run_all

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
        time.sleep(0.1)
        return os.getpid(), [os.environ.get(f"{name}_NUM_THREADS") for name in ("OPENBLAS", "NUMBA")]


    def asleep(folder):
        (Path(folder) / str(os.getpid())).touch()
        time.sleep(60)


    def itself(_):
        return os.getpid(), os.getpriority(os.PRIO_PROCESS, 0)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Generator[Path]:
    """A folder that this process and its workers can import the module `worker_jobs` from."""
    place = tmp_path_factory.mktemp("importable")
    (place / "worker_jobs.py").write_text(textwrap.dedent(JOBS))
    sys.path.insert(0, str(place))
    yield place
    sys.path.remove(str(place))
    sys.modules.pop("worker_jobs", None)


@pytest.fixture
def job(folder: Path) -> Callable[[str], Callable[[Any], Any]]:
    return lambda name: getattr(import_module("worker_jobs"), name)


GetJob = Callable[[str], Callable[[Any], Any]]


def test_two_workers_make_what_one_makes_without_dask(job: GetJob, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"pip install.*\[cluster\]"):
        run_all([1, 2], float, cluster="tcp://127.0.0.1:8786")
    one = list(run_all(range(8), job("noise"), workers=1))
    assert [number for number, _ in one] == list(range(8))
    assert sorted(run_all(range(8), job("noise"), workers=2)) == one


def test_a_killed_worker_loses_nothing_and_duplicates_nothing(job: GetJob, tmp_path: Path) -> None:
    jobs = [(str(tmp_path), number) for number in range(8)]
    done = list(run_all(jobs, job("first_time_killed"), workers=2))
    assert sorted(done) == [(each, each[1] ** 2) for each in jobs]
    assert (tmp_path / "died").exists()
    assert (tmp_path / "begun 3").read_text() == "xx"


def test_a_job_that_always_kills_its_worker_is_given_up_in_one_line(job: GetJob) -> None:
    with pytest.raises(DeviceError, match="3 times"):
        list(run_all(range(3), job("killed"), workers=2))


@pytest.mark.parametrize("workers", [1, 2])
def test_what_a_job_refuses_comes_home_as_it_was(job: GetJob, workers: int) -> None:
    with pytest.raises(InputError) as caught:
        list(run_all([1, 1], job("refused"), workers=workers))
    assert (caught.value.given, caught.value.remedy) == ("job 1", "leave it out")


def test_workers_are_other_processes_of_one_thread_and_the_environment_is_restored(job: GetJob) -> None:
    before = dict(os.environ)
    results = dict(run_all(range(6), job("surroundings"), workers=2))
    assert dict(os.environ) == before
    assert len({pid for pid, _ in results.values()} - {os.getpid()}) == 2
    assert all(threads == ["1", "1"] for _, threads in results.values())


def test_few_jobs_run_here_unless_workers_are_named(job: GetJob) -> None:
    jobs, here = dict.fromkeys(range(6), "a job"), {os.getpid()}
    for number, few, elsewhere in ((None, True, False), (2, True, True), (2, False, True)):
        results = dict(Spread(workers=number)(jobs, job("surroundings"), few=few))
        assert ({pid for pid, _ in results.values()} != here) is elsewhere


def test_one_worker_takes_job_after_job_and_starts_again_where_it_died(job: GetJob) -> None:
    worker = Worker(job("itself"), niceness=1)
    pid, niceness = worker.submit(None).result(60)
    assert pid != os.getpid()
    assert niceness == min(os.getpriority(os.PRIO_PROCESS, 0) + 1, 19)
    assert worker.submit(None).result(60) == (pid, niceness)
    os.kill(pid, signal.SIGKILL)
    wait_for(lambda: not psutil.pid_exists(pid))
    again, _ = worker.submit(None).result(60)
    assert again != pid
    worker.end()
    assert not psutil.pid_exists(again)
    worker.end()


def test_one_worker_is_ended_whatever_it_does(job: GetJob, tmp_path: Path) -> None:
    worker = Worker(job("asleep"))
    result = worker.submit(str(tmp_path))
    wait_for(lambda: any(tmp_path.iterdir()))
    worker.end()
    with pytest.raises(BrokenProcessPool):
        result.result(10)
    (file,) = tmp_path.iterdir()
    assert not psutil.pid_exists(int(file.name))


def test_closing_early_ends_every_worker_and_nothing_listens(job: GetJob) -> None:
    running = run_all(range(50), job("surroundings"), workers=2)
    next(running)
    me = psutil.Process()
    family = [me, *me.children(recursive=True)]
    ports = [place for each in family for place in each.net_connections("inet") if place.status == "LISTEN"]
    assert not ports
    running.close()  # pyright: ignore[reportAttributeAccessIssue]
    assert not [child for child in me.children(recursive=True) if "spawn_main" in " ".join(child.cmdline())]


@pytest.mark.slow
def test_two_pools_at_once_do_not_collide(job: GetJob) -> None:
    first = run_all(range(20), job("surroundings"), workers=2)
    next(first)
    assert len(list(run_all(range(4), job("noise"), workers=2))) == 4
    assert len(list(first)) == 19


def test_no_jobs_and_one_job_start_no_process(job: GetJob) -> None:
    assert list(run_all([], job("surroundings"))) == []
    ((_, (pid, _)),) = run_all(["one"], job("surroundings"))
    assert pid == os.getpid()


def test_fewer_than_one_worker_is_refused() -> None:
    with pytest.raises(InputError, match="0 workers"):
        run_all([1, 2], float, workers=0)


def test_a_script_needs_no_guard(folder: Path, tmp_path: Path) -> None:
    script = tmp_path / "unguarded.py"
    script.write_text(
        f"import sys\nsys.path.insert(0, {str(folder)!r})\nimport worker_jobs\n"
        "from monochord.core.workers import run_all\n"
        "print(len(list(run_all(range(4), worker_jobs.noise, workers=2))))\n"
    )
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.stdout, done.stderr) == ("4\n", "")


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "not an address"])
def test_an_address_where_nothing_answers_is_refused(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "ANSWER_TIMEOUT", 0.5)
    with pytest.raises(InputError, match=address):
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
    paths = os.pathsep.join([str(place), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = {**os.environ, "PYTHONPATH": paths}
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
        wait_for(place.exists)
        time.sleep(0.1)
        yield json.loads(place.read_text())["address"]
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait(20)


@pytest.mark.slow
def test_a_cluster_by_its_address_does_the_same(job: GetJob, scheduler: str, tmp_path: Path) -> None:
    assert sorted(run_all(range(4), job("noise"), cluster=scheduler)) == list(
        run_all(range(4), job("noise"), workers=1)
    )
    jobs = [(str(tmp_path), number) for number in range(6)]
    done = list(run_all(jobs, job("first_time_killed"), cluster=scheduler))
    assert sorted(done) == [(each, each[1] ** 2) for each in jobs]
    with pytest.raises(InputError, match="job 1"):
        list(run_all([1], job("refused"), cluster=scheduler))


@pytest.mark.slow
@pytest.mark.parametrize("scheduler", ["another"], indirect=True)
def test_a_cluster_with_other_code_is_one_line(job: GetJob, scheduler: str) -> None:
    with pytest.raises(DeviceError, match=r"monochord\.core"):
        list(run_all([1, 2], job("noise"), cluster=scheduler))


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_the_workers_end_with_the_program(folder: Path, tmp_path: Path, end: int) -> None:
    script = tmp_path / "program.py"
    script.write_text(
        textwrap.dedent(f"""
        import sys
        sys.path.insert(0, {str(folder)!r})
        import worker_jobs
        from monochord.core import workers
        if __name__ == "__main__":
            list(workers.run_all([{str(tmp_path)!r}] * 4, worker_jobs.asleep, workers=2))
        """)
    )
    program = subprocess.Popen(
        [sys.executable, str(script)], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    deadline = time.monotonic() + 60.0
    while len(busy := [int(path.name) for path in tmp_path.iterdir() if path.name.isdigit()]) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    if end == signal.SIGINT:
        os.killpg(program.pid, end)  # as a terminal sends it: to the workers too
    else:
        program.kill()
    _, errors = program.communicate(timeout=60)
    until = time.monotonic() + 20.0
    while any(map(psutil.pid_exists, busy)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(map(psutil.pid_exists, busy))
    if end == signal.SIGINT:
        assert len(re.findall("^Traceback", errors, re.MULTILINE)) <= 1, errors
        assert errors.strip().endswith("KeyboardInterrupt")
