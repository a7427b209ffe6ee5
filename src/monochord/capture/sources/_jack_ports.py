"""Which of a JACK server's output ports to listen to."""

import re

from monochord.capture.jack.client import JackClient
from monochord.core.errors import DeviceError, InputError


def choose_ports(client: JackClient, ports: str, channels: int) -> list[str]:
    """Return the full names of the first `channels` output ports that `ports` describes.

    `ports` is names, or regular expressions found in full names, with commas between; empty means the
    physical ports.

    Raises
    ------
    InputError
        If an expression cannot be read.
    DeviceError
        If fewer ports match than there are channels.
    """
    if ports:
        found = [name for part in ports.split(",") for name in _matching(client, part.strip())]
    else:
        found = client.outputs(physical=True)
    chosen = list(dict.fromkeys(found))[:channels]
    if len(chosen) < channels:
        wanted = f"ports '{ports}'" if ports else "physical capture ports"
        there = ", ".join(client.outputs()) or "none"
        advice = f"set channels={len(chosen)}" if chosen else "start what plays, or set ports=none"
        raise DeviceError(f"JACK {wanted}: {len(chosen)} of {channels} found; there are {there}; {advice}")
    return chosen


def _matching(client: JackClient, expression: str) -> list[str]:
    try:
        pattern = re.compile(expression)
    except re.error as error:
        raise InputError(f"ports '{expression}' ({error})", "regular expressions, commas between") from error
    names = client.outputs()
    # A name that is itself meant is not to be read as an expression: "a (b):out" holds brackets.
    return [name for name in names if name == expression] or [n for n in names if pattern.search(n)]
