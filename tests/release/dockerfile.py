"""Carries out a Dockerfile without Docker: its steps, in its order, in a Debian of their own.

The base image is what `debootstrap` makes of the release that ``FROM`` names. Each ``RUN`` has its own
processes and its own ``/proc``; name resolution, certificates and package index are those of this machine.
"""

import json
import os
import shlex
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tests.release.base import CheckFailedError, NotHereError, run

CERTIFICATES = Path("/etc/ssl/certs/ca-certificates.crt")
COPIED = "etc/ssl/machine.crt"
"""Where in the container this machine's certificates lie: its packages write their own elsewhere."""
IGNORED = {"__pycache__"}


def instructions(text: str) -> Iterator[tuple[str, str]]:
    """Yield each instruction of a Dockerfile with its arguments, without comments.

    >>> list(instructions("# slim\\nFROM debian:bookworm-slim\\nRUN one \\\\\\n    && two\\n"))
    [('FROM', 'debian:bookworm-slim'), ('RUN', 'one && two')]
    """
    lines = [line for line in text.splitlines() if not line.lstrip().startswith("#")]
    for line in "\n".join(lines).replace("\\\n", " ").splitlines():
        word, _, rest = line.strip().partition(" ")
        if word:
            yield word.upper(), " ".join(rest.split())


@dataclass(kw_only=True)
class Container:
    """A folder that holds the root of a system, and what the instructions so far have set."""

    root: Path
    context: Path
    user: str = "root"
    folder: str = "/"
    variables: dict[str, str] = field(default_factory=dict[str, str])
    entrypoint: list[str] = field(default_factory=list[str])
    command: list[str] = field(default_factory=list[str])

    def carry_out(self, word: str, rest: str) -> None:
        """Carry out an instruction; raises `CheckFailedError` where it fails or is unknown."""
        match word:
            case "FROM":
                self._begin(rest)
            case "RUN":
                pip = {name: os.environ[name] for name in ("PIP_INDEX_URL",) if name in os.environ}
                pip |= {"PIP_CERT": f"/{COPIED}"} if CERTIFICATES.exists() else {}
                run(*self.enter(pip), "/bin/sh", "-c", rest)
            case "COPY":
                self._copy(rest.split())
            case "ENV":
                self.variables |= dict(each.split("=", 1) for each in shlex.split(rest))
            case "USER":
                self.user = rest
            case "WORKDIR":
                self.folder = rest
                run(*self.enter(folder="/"), "/bin/mkdir", "-p", rest)
            case "ENTRYPOINT":
                self.entrypoint = json.loads(rest)
            case "CMD":
                self.command = json.loads(rest)
            case "EXPOSE":
                pass
            case _:
                raise CheckFailedError(f"Dockerfile: {word} is not carried out here; use another instruction")

    def enter(self, more: dict[str, str] = {}, folder: str = "") -> list[str]:  # noqa: B006
        """Return the words before a command that runs in the container, with its variables and its user."""
        home = "/root" if self.user == "root" else f"/home/{self.user}"
        variables = {"PATH": "/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", "HOME": home, "LANG": "C.UTF-8"}
        isolated = ["unshare", "--mount", "--pid", "--uts", "--fork", "--kill-child"]
        return [
            *isolated, f"--mount-proc={self.root}/proc", "chroot", f"--userspec={self.user}:{self.user}",
            str(self.root), "/usr/bin/env", "-i", f"--chdir={folder or self.folder}",
            *(f"{name}={value}" for name, value in (variables | self.variables | more).items()),
        ]  # fmt: skip

    def _begin(self, image: str) -> None:
        name, _, tag = image.partition(":")
        release = tag.removesuffix("-slim")
        if name != "debian":
            raise CheckFailedError(f"Dockerfile: FROM {image}: only images of debian can be made here")
        if os.geteuid() or not shutil.which("debootstrap"):
            raise NotHereError(
                "the Dockerfile's steps take root and debootstrap (Debian: apt install debootstrap)"
            )
        if not (self.root / "etc/debian_version").exists():
            run("debootstrap", "--variant=minbase", release, self.root)
        shutil.copy("/etc/resolv.conf", self.root / "etc/resolv.conf")
        if CERTIFICATES.exists():
            (self.root / COPIED).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(CERTIFICATES, self.root / COPIED)

    def _copy(self, words: list[str]) -> None:
        *sources, target = words
        place = self.root / target.lstrip("/")
        for source in sources:
            path = self.context / source
            if path.is_dir():
                shutil.copytree(path, place, ignore=shutil.ignore_patterns(*IGNORED), dirs_exist_ok=True)
            else:
                place.mkdir(parents=True, exist_ok=True)
                shutil.copy(path, place)


def build(file: Path, root: Path) -> Container:
    """Carry out all instructions of a Dockerfile into a folder; each is printed as it begins."""
    container = Container(root=root, context=file.parent)
    for word, rest in instructions(file.read_text(encoding="utf-8")):
        print(f"  {word} {rest[:90]}", flush=True)
        container.carry_out(word, rest)
    return container
