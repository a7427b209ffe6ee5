"""The JACK C library: the functions that Monochord calls, with its console messages silenced.

The functions are declared with ctypes rather than a binding, so that JACK's threads enter only compiled code.
The names are JACK's (https://jackaudio.org/api/).
"""

import ctypes
import os
import re
from ctypes import POINTER, c_char_p, c_float, c_int, c_uint32, c_uint64, c_ulong, c_void_p
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

from monochord.core.errors import DeviceError
from monochord.core.printable import printable

NAMES = ("libjack.so.0", "libjack.so", "libjack.dylib", "/opt/homebrew/lib/libjack.dylib")
AUDIO = b"32 bit float mono audio"
START_JACK = (
    "start JACK (Debian: apt install jackd2): jackd -R -d alsa -d hw:USB -r 44100 -p 128 (hw:USB is a"
    " Scarlett on USB, 'arecord -l' lists other cards); where PipeWire runs, put pw-jack before the command"
    " instead"
)
"""Remedy where JACK or its server is missing."""
USE_PIPEWIRE = (
    "PipeWire runs here and is a JACK server too: put pw-jack before the command"
    " (Debian: apt install pipewire-jack)"
)
"""Remedy where PipeWire runs, and the command uses another JACK."""
START_PIPEWIRE = "start PipeWire: systemctl --user start pipewire wireplumber"
"""Remedy under ``pw-jack`` where PipeWire does not run."""
NO_START_SERVER, SERVER_NAME = 0x01, 0x04  # jack_options_t
IS_INPUT, IS_OUTPUT, IS_PHYSICAL = 0x1, 0x2, 0x4  # enum JackPortFlags
CAPTURE_LATENCY = 0  # jack_latency_callback_mode_t


class LatencyRange(ctypes.Structure):
    """``jack_latency_range_t``: smallest and largest latency in frames."""

    _fields_: ClassVar = [("min", c_uint32), ("max", c_uint32)]


DECLARATIONS: dict[str, tuple[Any, list[Any]]] = {
    "jack_client_close": (c_int, [c_void_p]),
    "jack_get_client_name": (c_char_p, [c_void_p]),
    "jack_get_sample_rate": (c_uint32, [c_void_p]),
    "jack_get_buffer_size": (c_uint32, [c_void_p]),
    "jack_is_realtime": (c_int, [c_void_p]),
    "jack_activate": (c_int, [c_void_p]),
    "jack_set_process_callback": (c_int, [c_void_p, c_void_p, c_void_p]),
    "jack_set_xrun_callback": (c_int, [c_void_p, c_void_p, c_void_p]),
    "jack_set_port_registration_callback": (c_int, [c_void_p, c_void_p, c_void_p]),
    "jack_on_shutdown": (None, [c_void_p, c_void_p, c_void_p]),
    "jack_port_register": (c_void_p, [c_void_p, c_char_p, c_char_p, c_ulong, c_ulong]),
    "jack_port_name": (c_char_p, [c_void_p]),
    "jack_port_connected": (c_int, [c_void_p]),
    "jack_port_get_latency_range": (None, [c_void_p, c_int, POINTER(LatencyRange)]),
    "jack_get_ports": (POINTER(c_char_p), [c_void_p, c_char_p, c_char_p, c_ulong]),
    "jack_free": (None, [c_void_p]),
    "jack_connect": (c_int, [c_void_p, c_char_p, c_char_p]),
    "jack_get_time": (c_uint64, []),
    "jack_time_to_frames": (c_uint32, [c_void_p, c_uint64]),
    "jack_get_cycle_times": (
        c_int,
        [c_void_p, POINTER(c_uint32), POINTER(c_uint64), POINTER(c_uint64), POINTER(c_float)],
    ),
    "jack_set_error_function": (None, [c_void_p]),
    "jack_set_info_function": (None, [c_void_p]),
}


def decoded(name: bytes) -> str:
    """Return a JACK name as text; it may hold any bytes, which `encoded` restores."""
    return name.decode("utf-8", "surrogateescape")


def encoded(name: str) -> bytes:
    """Return the bytes of a name."""
    return name.encode("utf-8", "surrogateescape")


def shown(name: str) -> str:
    r"""Return a name for display and typing; bytes that are not text become escapes.

    >>> shown(decoded(b"St\xc3:out")), shown("USB Audio (hw:1,0):out")
    ('St\\xc3:out', 'USB Audio (hw:1,0):out')
    """
    return printable(encoded(name).decode("utf-8", "backslashreplace"))


@cache
def path() -> str:
    """Return the dynamic linker's name of the JACK library; raises `DeviceError` where it is missing."""
    for name in NAMES:
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return name
    raise DeviceError(f"JACK library libjack: not found; {START_JACK}")


@cache
def library() -> ctypes.CDLL:
    """Return the library with its functions declared."""
    jack = ctypes.CDLL(path())
    for name, (result, arguments) in DECLARATIONS.items():
        function = getattr(jack, name)
        function.restype, function.argtypes = result, arguments
    # This one takes the server's name as a variable argument, so only its result is declared.
    jack.jack_client_open.restype = c_void_p
    return jack


def pipewire() -> str:
    """Return the version of PipeWire whose library this is, as under ``pw-jack``; empty for any other."""
    try:
        version = library().jack_get_version_string
    except AttributeError:  # an old JACK
        return ""
    version.restype = c_char_p
    match = re.search(r"PipeWire (\S+?)\)?$", decoded(version()))
    return match[1] if match else ""


def no_server() -> str:
    """Return the remedy where no server answers: how to start one, or how to use PipeWire where it runs."""
    if pipewire():
        return START_PIPEWIRE
    variables = (os.environ.get(name) for name in ("PIPEWIRE_RUNTIME_DIR", "XDG_RUNTIME_DIR"))
    folder = next(filter(None, variables), "/run/pipewire")
    socket = Path(folder, os.environ.get("PIPEWIRE_REMOTE") or "pipewire-0")
    return USE_PIPEWIRE if socket.is_socket() else START_JACK
