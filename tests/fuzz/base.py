"""What a target of the fuzzer is, and what goes into it: named bytes, one file or a folder of them."""

import io
import zipfile
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import TypeAlias

from monochord.core.errors import DeviceError, InputError

Input: TypeAlias = dict[str, bytes]
"""Bytes by file name, folders with ``/``."""
REFUSALS = (InputError, DeviceError)
SHORT = 20_000
TARGETS = Path(__file__).with_name("targets")


class Target(ABC):
    """A part of Monochord that reads what others may have damaged or made up.

    `run` raises `InputError` or `DeviceError` where the input is refused, returns where it is accepted, and
    fails in any other way where there is a fault to find.
    """

    @abstractmethod
    def seeds(self, folder: Path) -> Iterator[Input]:
        """Yield small valid inputs, made by the real writers; `folder` is empty and may be used."""

    @abstractmethod
    def run(self, folder: Path) -> None:
        """Read the input, which lies in `folder`."""

    def warm(self) -> None:  # noqa: B027  (most have nothing to make ready)
        """Make ready what the first case would wait for, such as a server and its compiled kernels."""

    def fit(self, edited: Input) -> Input:
        """Return an edited input with what guards it from edits, such as a checksum, made right again."""
        return edited


def target_names(folder: Path) -> list[str]:
    """Return the names of the targets in a folder: one file each, with one subclass `Fuzz` of `Target`."""
    return sorted(file.stem for file in folder.glob("*.py") if not file.stem.startswith("_"))


def load_target(folder: Path, name: str) -> Target:
    """Return a target by its name."""
    spec = spec_from_file_location(f"fuzz_target_{name}", folder / f"{name}.py")
    assert spec
    assert spec.loader
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Fuzz()


def pack(name: str, given: Input) -> tuple[str, bytes]:
    """Return file name and content that keep an input: a short file itself, else a zip."""
    if len(given) == 1 and len(next(iter(given.values()))) <= SHORT:
        ((file, content),) = given.items()
        return f"{name}-{file}", content
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(given):
            entry = zipfile.ZipInfo(file)  # dated 1980, so that equal inputs give equal bytes
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, given[file])
    return f"{name}.zip", stream.getvalue()


def unpack(file: Path) -> Input:
    """Return the input that `pack` kept in a file."""
    if file.suffix != ".zip":
        return {file.name.partition("-")[2]: file.read_bytes()}
    with zipfile.ZipFile(file) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def lay_out(given: Input, folder: Path) -> None:
    """Write an input into a folder."""
    for name, content in given.items():
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)


def taken_from(folder: Path) -> Input:
    """Return what lies in a folder."""
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    return {file.relative_to(folder).as_posix(): file.read_bytes() for file in files}


def given_file(folder: Path, name: str) -> Path:
    """Return a file of the input; raises `InputError` where an edit has taken it away."""
    if not (folder / name).exists():
        raise InputError(f"no {name}", "one")
    return folder / name


def command(*arguments: object) -> str:
    """Run `monochord` in this process and return what it printed; raises `InputError` for status 2.

    Any other status than 0 and 2 is a fault, and so is a refusal without its line.
    """
    from monochord.cli import run

    out, errors = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(errors):
        status = run([str(each) for each in arguments])
    lines = errors.getvalue().splitlines()
    if status == 0:
        return out.getvalue()
    assert status == 2, f"status {status}: {lines}"
    assert lines or out.getvalue().strip(), "refused without a word"
    raise InputError(lines[-1] if lines else out.getvalue().strip(), "what the command says")
