"""Check a release before it is published: ``python -m tests.release``, or ``make release-check``.

Builds wheel and sdist; uses the wheel in an empty environment of every Python from 3.11 that is found, and
the sdist in one; lists the installed size by package; runs the one-liners of uvx and pipx; checks
CITATION.cff; and carries out the Dockerfile's steps, whose page is fetched from another network. The package
index must be reachable.
"""

import argparse
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path

from tests.networks import NoNetworkError, two_networks
from tests.release import sizes
from tests.release.base import ROOT, CheckFailedError, NotHereError, environment_of, run, tools
from tests.release.dockerfile import build
from tests.release.page import fetched

OLDEST, NEWEST = 11, 16
"""Minor versions of Python 3 that are looked for."""
FOLDERS = (".pyenv/versions/*/bin", ".local/share/uv/python/*/bin")
"""Where in the home folder Pythons are kept that are not in PATH."""
USE = ROOT / "tests/release/use.py"
ONE_LINERS = {
    "uvx": "uvx --from {wheel} monochord demo --seconds 2 --json",
    "pipx": "pipx run --spec {wheel} monochord demo --seconds 2 --json",
}


def pythons() -> dict[str, Path]:
    """Return the first Python of each minor version that runs and makes virtual environments."""
    found: dict[str, Path] = {}
    for minor in range(OLDEST, NEWEST + 1):
        name = f"python3.{minor}"
        beside = (each for folder in FOLDERS for each in sorted(Path.home().glob(f"{folder}/{name}")))
        for path in filter(None, (shutil.which(name), *beside)):
            code = "import ensurepip, venv"
            if not subprocess.run([path, "-c", code], capture_output=True, check=False).returncode:
                found[f"3.{minor}"] = Path(path)
                break
    return found


class Release:
    """The checks, each a method; what is built lies in `out`."""

    def __init__(self, out: Path, wanted: Iterable[str]) -> None:
        self.out, self.wanted = out, frozenset(wanted)

    @property
    def wheel(self) -> Path:
        """The built wheel."""
        return self._only("monochord-*.whl")

    def _only(self, pattern: str) -> Path:
        files = sorted((self.out / "dist").glob(pattern))
        if len(files) != 1:
            raise CheckFailedError(
                f"{len(files)} files {pattern} in {self.out / 'dist'}: run the check 'build'"
            )
        return files[0]

    def build(self) -> str:
        """Build the sdist, the wheel from it, and the wheels of the packages beside it."""
        shutil.rmtree(self.out / "dist", ignore_errors=True)
        python = tools(self.out / "tools", "build", "cffconvert", "uv", "pipx") / "python"
        run(python, "-m", "build", "--outdir", self.out / "dist", ROOT)
        for project in sorted(ROOT.glob("packages/*/pyproject.toml")):
            run(python, "-m", "build", "--wheel", "--outdir", self.out / "dist", project.parent)
        return ", ".join(
            f"{file.name} {file.stat().st_size / 1e6:.1f} MB"
            for file in sorted((self.out / "dist").iterdir())
        )

    def use(self) -> str:
        """Use the wheel in an empty environment of each Python, and the sdist in one of the oldest."""
        found = {name: path for name, path in pythons().items() if name in self.wanted or not self.wanted}
        if not found:
            raise NotHereError(f"no Python {', '.join(sorted(self.wanted)) or 'from 3.11'} is found")
        for name, python in found.items():
            self._used(python, self.out / f"use-{name}-wheel", self.wheel)
        oldest, sdist = next(iter(found)), self._only("monochord-*.tar.gz")
        self._used(found[oldest], self.out / f"use-{oldest}-sdist", sdist, "locate")
        return f"{len(found)} Pythons: {', '.join(found)}"

    def _used(self, python: Path, folder: Path, package: Path, *words: str) -> None:
        """Install a package into an empty environment, and use it."""
        programs, work = environment_of(python, folder, package), folder / "work"
        work.mkdir()
        own = {"NUMBA_CACHE_DIR": str(folder / "kernels")}
        told = run(programs / "python", "-I", USE, *words, folder=work, environment=own)
        print(f"  {package.name}, {told}", end="", flush=True)

    def size(self) -> str:
        """Compare the installed size of each package of the core with the recorded one."""
        (site, *_) = sorted(self.out.glob("use-*-wheel/lib/python3*/site-packages")) or (None,)
        if site is None:
            raise CheckFailedError("no environment is there: run the check 'use'")
        now, then = sizes.sizes(site), sizes.recorded()
        print(sizes.table(now, then))
        if lines := sizes.grown(now, then):
            told = "; ".join(lines)
            raise CheckFailedError(
                f"{told}. Drop it, make it an extra, or record it in {sizes.RECORDED.name}"
            )
        return f"{sum(now.values()):.0f} MB in {len(now)} packages"

    def one_liners(self) -> str:
        """Run the demonstration from the wheel's file by uvx and by pipx."""
        bin_folder = tools(self.out / "tools", "build", "cffconvert", "uv", "pipx")
        own = {name: str(self.out / name) for name in ("UV_CACHE_DIR", "PIPX_HOME", "NUMBA_CACHE_DIR")}
        own["UV_NATIVE_TLS"] = "1"  # the certificates that pip uses
        for name, line in ONE_LINERS.items():
            words = line.format(wheel=self.wheel).split()
            run(bin_folder / words[0], *words[1:], environment=own)
            print(f"  {name}: {line.format(wheel=self.wheel.name)}", flush=True)
        return f"{len(ONE_LINERS)} run"

    def citation(self) -> str:
        """Check CITATION.cff against the schema of its version."""
        program = tools(self.out / "tools", "build", "cffconvert", "uv", "pipx") / "cffconvert"
        run(program, "--validate", "--infile", ROOT / "CITATION.cff")
        return "CITATION.cff is valid"

    def container(self) -> str:
        """Carry out the Dockerfile's steps, and fetch the page of its command from another network."""
        root = self.out / "root"
        shutil.rmtree(root, ignore_errors=True)
        container = build(ROOT / "Dockerfile", root)
        with two_networks() as networks:
            command = [*container.enter(), *container.entrypoint, *container.command]
            answers = fetched(networks, command)
        if answers[0] != "200 True" or not answers[1].startswith("40"):
            raise CheckFailedError(f"with its token the page answers {answers[0]}, without it {answers[1]}")
        return "the page answers to another network, and only to its token"


CHECKS = ("build", "citation", "use", "size", "one_liners", "container")


def main() -> int:
    """Run what the arguments say; the status is 1 if a check failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.release", description=__doc__)
    parser.add_argument("checks", nargs="*", metavar="CHECK", help=f"of {', '.join(CHECKS)}; all by default")
    parser.add_argument(
        "--python", action="append", default=[], metavar="3.N", help="use this one; repeatable"
    )
    parser.add_argument("--out", type=Path, default=ROOT / "build/release", help="where it works")
    options = parser.parse_args()
    if strange := set(options.checks) - set(CHECKS):
        parser.error(f"check {', '.join(sorted(strange))}: expected {', '.join(CHECKS)}")
    options.out.mkdir(parents=True, exist_ok=True)
    release, failed = Release(options.out.resolve(), options.python), False
    for name in options.checks or CHECKS:
        check: Callable[[], str] = getattr(release, name)
        begun = time.monotonic()
        print(f"{name} ...", flush=True)
        try:
            verdict = f"ok: {check()}"
        except (NotHereError, NoNetworkError) as error:
            verdict = f"left out: {error}"
        except CheckFailedError as error:
            verdict, failed = f"FAILED: {error}", True
        print(f"{name} {verdict} ({time.monotonic() - begun:.0f} s)", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
