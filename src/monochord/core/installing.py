"""The lines that install what an optional part of Monochord needs: in errors and on every page.

PyTorch from the default index of packages brings gigabytes of libraries for a graphics card on Linux, also as
a dependency of something else. So it comes first, from PyTorch's own index of builds for the CPU. For macOS
and Windows, the default index has such builds too.
"""

import shlex
import sys
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from json import loads
from pathlib import Path
from urllib.parse import unquote, urlsplit

TORCH = "torch==2.13.0"
"""The release of PyTorch that Monochord is tested with."""
TORCH_INDEX = "https://download.pytorch.org/whl/cpu"
"""The index that PyTorch's own installation page names for its builds for the CPU."""
NAME = "monochord"
PACKAGES: Mapping[str, tuple[str, ...]] = {
    "monochord-encoders": ("monochord-encoders",),
    "monochord-yamnet": ("monochord-encoders", "monochord-yamnet"),
}
"""Packages in the folder `packages` that add to Monochord, each with those that are installed for it."""


def installation(extra: str) -> str:
    """Return the command that installs an extra's libraries, or a package, into the running environment.

    One library is installed by its name; several as the extra of whatever Monochord was installed from, a
    checkout or a wheel, or each by its name where that is gone. PyTorch comes first and separately. A package
    of `PACKAGES` is installed from its folder in the checkout; a comment says what to name elsewhere.

    Parameters
    ----------
    extra
        The name of an extra, of a package in `PACKAGES`, or of a library that belongs to no extra.

    Examples
    --------
    >>> installation("train")
    '...python... -m pip install torch==2.13.0 --index-url https://download.pytorch.org/whl/cpu'
    >>> installation("pandas").endswith("pip install 'pandas>=2.2'")
    True
    """
    if extra in PACKAGES:
        return _package_installation(PACKAGES[extra])
    needed = _requirements(extra)
    others = [name for name in needed if not name.startswith("torch")]
    if len(others) > 1 and (source := _source()):
        arguments = [*source[:-1], f"{source[-1]}[{extra}]"]
    else:
        arguments = others or ([] if needed else [extra])
    lines = [_torch_line()] * (len(others) < len(needed))
    return " && ".join([*lines, *([f"{_pip()} {shlex.join(arguments)}"] if arguments else [])])


def _package_installation(packages: tuple[str, ...]) -> str:
    checkout = Path((_source() or ["."])[-1])
    checkout = checkout if (checkout / "packages").is_dir() else Path()
    start = "" if checkout.is_absolute() else "./"
    folders = [shlex.quote(f"{start}{checkout / 'packages' / name}") for name in packages]
    wheels = " and ".join(f"{name.replace('-', '_')}-*.whl" for name in packages)
    lines = [_torch_line()] * (find_spec("torch") is None)
    line = " && ".join([*lines, f"{_pip()} {' '.join(folders)}"])
    return f"{line} # in a checkout of Monochord; elsewhere from {wheels}"


def _pip() -> str:
    python = Path(sys.executable)
    if python.is_relative_to(Path.cwd()):
        python = python.relative_to(Path.cwd())
    return f"{shlex.quote(str(python))} -m pip install"


def _torch_line() -> str:
    index = ["--index-url", TORCH_INDEX] if sys.platform == "linux" else []
    return f"{_pip()} {shlex.join([TORCH, *index])}"


def _requirements(extra: str) -> list[str]:
    texts = [line.partition(";") for line in distribution(NAME).requires or ()]
    return [name.strip() for name, _, marker in texts if f"extra == '{extra}'" in marker.replace('"', "'")]


def _source() -> list[str]:
    """Return what pip is to be given for this Monochord: a checkout or a wheel; empty if it is gone.

    pip notes in ``direct_url.json`` what it installed from; without it, that was an index (PEP 610).
    """
    try:
        noted = loads(distribution(NAME).read_text("direct_url.json") or "{}")
        path = Path(unquote(urlsplit(noted.get("url", "")).path))
        is_file = urlsplit(noted.get("url", "")).scheme == "file"
    except (PackageNotFoundError, OSError, ValueError, AttributeError):
        return []
    if not noted:
        return [NAME]
    if not is_file or not path.exists():
        return []
    place = "." if path == Path.cwd() else str(path)
    editable = noted.get("dir_info", {}).get("editable", False)
    return ["--editable", place] if editable else [place]
