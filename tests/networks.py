"""Two network namespaces with a cable between them: what comes from another network, on one machine."""

import os
import shutil
import subprocess
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass


class NoNetworkError(Exception):
    """No network namespace can be made; the text says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Networks:
    """Words before a command that runs in the near or in the far network, and the near one's address."""

    near: tuple[str, ...]
    far: tuple[str, ...]
    address: str


@contextmanager
def two_networks() -> Generator[Networks]:
    """Make the networks, and remove them at the end; raises `NoNetworkError` where they cannot be made."""
    if os.geteuid() or not shutil.which("ip"):
        raise NoNetworkError("a network of its own takes root and iproute2")
    near, far = (f"monochord-{side}-{os.getpid()}" for side in ("near", "far"))
    with ExitStack() as stack:
        for name in (near, far):
            made = subprocess.run(["ip", "netns", "add", name], capture_output=True, text=True, check=False)
            if made.returncode:
                raise NoNetworkError(f"no network namespace can be made here: {made.stderr.strip()}")
            stack.callback(subprocess.run, ["ip", "netns", "del", name], check=True)
        for words in (
            f"-n {near} link add cable type veth peer name cable netns {far}",
            f"-n {near} link set lo up",
            f"-n {near} link set cable up",
            f"-n {far} link set cable up",
            f"-n {near} addr add 192.0.2.1/24 dev cable",
            f"-n {far} addr add 192.0.2.2/24 dev cable",
        ):
            subprocess.run(["ip", *words.split()], check=True)
        inside, outside = (("ip", "netns", "exec", name) for name in (near, far))
        yield Networks(near=inside, far=outside, address="192.0.2.1")
