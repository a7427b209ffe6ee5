"""Checks whether this machine is ready for live audio, with a remedy for each problem."""

import ctypes
import mmap
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from monochord.capture.jack.client import JackClient
from monochord.capture.jack.libjack import START_JACK, no_server, pipewire
from monochord.capture.jack.libjack import path as jack_library
from monochord.core.errors import DeviceError

OK, WARN, MISSING = "ok", "warn", "missing"
GOVERNOR = Path("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")
LIMITS = "in /etc/security/limits.d/audio.conf, then log in again"
LOCKED_MEMORY = 16 << 20  # bytes; more than the usual limit of 8 MB, less than a JACK client's
PRIORITY = 70  # of JACK's audio threads, at least


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineCheck:
    """The result of one check: `state` is ok, warn or missing; `remedy` says how to fix anything but ok."""

    name: str
    state: str
    detail: str
    remedy: str = ""
    required: bool = False


def checks() -> Iterator[MachineCheck]:
    """Run all checks in sequence; takes a second or two."""
    for look in (python, compile_cache, sound_files, jack, port_audio, priority, memory, governor):
        yield look()


def python() -> MachineCheck:
    """Check the Python version: 3.11 or later."""
    version, recent = sys.version.split()[0], sys.version_info >= (3, 11)
    return MachineCheck(
        name="Python",
        state=OK if recent else MISSING,
        detail=f"version {version}; 3.11 or later is needed",
        remedy="" if recent else "install Python 3.11 or later",
        required=True,
    )


def compile_cache() -> MachineCheck:
    """Check whether compiled kernels can be cached, so that only the first start is slow."""
    folder = Path(os.environ.get("NUMBA_CACHE_DIR") or Path(__file__).parents[2])
    writable = os.access(folder, os.W_OK) or (not folder.exists() and os.access(folder.parent, os.W_OK))
    return MachineCheck(
        name="compile cache",
        state=OK if writable else WARN,
        detail=f"compiled kernels {'are kept' if writable else 'cannot be kept'} in {folder}",
        remedy="" if writable else "set NUMBA_CACHE_DIR to a writable folder, or every start compiles again",
    )


def sound_files() -> MachineCheck:
    """Check for libsndfile, which reads audio files."""
    try:
        import soundfile  # noqa: F401, PLC0415  # pyright: ignore[reportUnusedImport]
    except OSError:
        remedy = "pip install --force-reinstall soundfile, or apt install libsndfile1"
        detail = "libsndfile, which reads them, is not installed"
        return MachineCheck(name="sound files", state=MISSING, detail=detail, remedy=remedy, required=True)
    return MachineCheck(name="sound files", state=OK, detail="WAV and FLAC can be read", required=True)


def jack() -> MachineCheck:
    """Check for JACK and a running server."""
    try:
        jack_library()
    except DeviceError:
        remedy = f"for live sound {START_JACK}"
        return MachineCheck(name="JACK", state=MISSING, detail="not installed", remedy=remedy)
    try:
        client = JackClient("monochord-doctor")
    except DeviceError:
        detail = "installed, but no server runs"
        return MachineCheck(name="JACK", state=WARN, detail=detail, remedy=f"for live sound: {no_server()}")
    with closing(client):
        rate, period, urgent = client.sample_rate, client.period, client.realtime
    name = f"PipeWire {version}" if (version := pipewire()) else "a server"
    server = f"{name} runs at {rate} Hz, with periods of {1e3 * period / rate:.1f} ms"
    if not urgent:
        remedy = "start it with -R, or it loses frames under load"
        return MachineCheck(name="JACK", state=WARN, detail=f"{server}, not in real time", remedy=remedy)
    return MachineCheck(name="JACK", state=OK, detail=f"{server}, in real time")


def port_audio() -> MachineCheck:
    """Check for PortAudio and its sound cards."""
    try:
        import sounddevice  # noqa: PLC0415
    except OSError:
        remedy = "for sound cards without JACK: apt install libportaudio2"
        detail = "PortAudio, which opens them, is not installed"
        return MachineCheck(name="sound cards", state=MISSING, detail=detail, remedy=remedy)
    inputs = [card["name"] for card in sounddevice.query_devices() if card["max_input_channels"] > 0]
    if not inputs:
        remedy = "for live sound connect a sound card with two inputs"
        return MachineCheck(
            name="sound cards", state=WARN, detail="none with an input is connected", remedy=remedy
        )
    return MachineCheck(name="sound cards", state=OK, detail=f"these have inputs: {', '.join(inputs)}")


def priority() -> MachineCheck:
    """Check whether a thread may run with real-time priority, like JACK's threads."""
    granted: list[bool] = []

    def ask() -> None:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        except OSError:
            return
        granted.append(True)

    thread = threading.Thread(target=ask)  # the priority ends with it
    thread.start()
    thread.join()
    return MachineCheck(
        name="real-time priority",
        state=OK if granted else WARN,
        detail=f"live threads {'may' if granted else 'may not'} have it",
        remedy="" if granted else f"put '@audio - rtprio 95' {LIMITS}",
    )


def memory() -> MachineCheck:
    """Check whether memory may be locked against swapping, as JACK's clients do."""
    libc = ctypes.CDLL(None)
    with mmap.mmap(-1, LOCKED_MEMORY) as block:
        view = ctypes.c_char.from_buffer(block)
        refused = libc.mlock(ctypes.byref(view), ctypes.c_size_t(LOCKED_MEMORY))
        del view  # or the memory could not be given back
    return MachineCheck(
        name="locked memory",
        state=WARN if refused else OK,
        detail=f"live threads {'may not' if refused else 'may'} keep their memory from being swapped out",
        remedy=f"put '@audio - memlock unlimited' {LIMITS}" if refused else "",
    )


def governor() -> MachineCheck:
    """Check whether the processor keeps its clock rate when idle."""
    try:
        governor = GOVERNOR.read_text(encoding="ascii").strip()
    except OSError:
        return MachineCheck(name="processor pace", state=OK, detail="this machine does not report it")
    slow = governor not in {"performance", "schedutil"}
    remedy = "for steady latency: cpupower frequency-set -g performance" if slow else ""
    detail = f"the governor '{governor}' {'slows an idle processor down' if slow else 'keeps it steady'}"
    return MachineCheck(name="processor pace", state=WARN if slow else OK, detail=detail, remedy=remedy)
