"""The lines that install what an optional part of Monochord needs: in errors, in `doctor`, and on every page.

PyTorch from the default index of packages brings gigabytes of libraries for a graphics card on Linux, also as
a dependency of something else. So it comes first, from PyTorch's own index of builds for the CPU. For macOS
and Windows, the default index has such builds too.
"""

import shlex
import sys
from importlib.metadata import PackageNotFoundError, distribution
from json import loads
from pathlib import Path
from urllib.parse import unquote, urlsplit

TORCH = "torch==2.13.0"
"""The release of PyTorch that Monochord is tested with."""
TORCH_INDEX = "https://download.pytorch.org/whl/cpu"
"""The index that PyTorch's own installation page names for its builds for the CPU."""
TORCH_LINE = f"pip install {TORCH} --index-url {TORCH_INDEX}"
"""The line on every page that installs PyTorch."""
NAME = "monochord"


def installation(extra: str) -> str:
    """Return the command that installs an extra's libraries into the running environment.

    One library is installed by its name; several as the extra of whatever Monochord was installed from, a
    checkout or a wheel, or each by its name where that is gone. PyTorch comes first and separately.

    Parameters
    ----------
    extra
        The name of an extra, or of a package that belongs to none.

    Examples
    --------
    >>> installation("train")
    '...python... -m pip install torch==2.13.0 --index-url https://download.pytorch.org/whl/cpu'
    >>> installation("pandas").endswith("pip install 'pandas>=2.2'")
    True
    """
    needed = _requirements(extra)
    others = [name for name in needed if not name.startswith("torch")]
    if len(others) > 1 and (source := _source()):
        arguments = [*source[:-1], f"{source[-1]}[{extra}]"]
    else:
        arguments = others or ([] if needed else [extra])
    python = Path(sys.executable)
    if python.is_relative_to(Path.cwd()):
        python = python.relative_to(Path.cwd())
    pip = f"{shlex.quote(str(python))} -m pip install"
    lines = [f"{pip} {shlex.join(arguments)}"] if arguments else []
    if len(others) < len(needed):
        index = ["--index-url", TORCH_INDEX] if sys.platform == "linux" else []
        lines.insert(0, f"{pip} {shlex.join([TORCH, *index])}")
    return " && ".join(lines)


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
