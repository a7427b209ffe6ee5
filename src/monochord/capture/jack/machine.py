"""What this machine offers to live audio, and what to do about what it lacks."""

import ctypes
import mmap
import os
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import monochord
from monochord.capture.jack.client import JackClient
from monochord.capture.jack.libjack import START_SERVER
from monochord.capture.jack.libjack import path as jack_library
from monochord.core.errors import DeviceError

OK, WARN, MISSING = "ok", "warn", "missing"
GOVERNOR = Path("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")
LIMITS = "in /etc/security/limits.d/audio.conf, then log in again"
LOCKED_MEMORY = 16 << 20  # bytes; more than the usual limit of 8 MB, less than a JACK client's
PRIORITY = 70  # of JACK's audio threads, at least


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One thing looked at: `state` is ok, warn or missing; `remedy` says what to do where it is not ok."""

    name: str
    state: str
    detail: str
    remedy: str = ""
    required: bool = False


def checks() -> Iterator[Check]:
    """Look at everything, one after another; takes a second or two."""
    for look in (python, compile_cache, sound_files, jack, port_audio, priority, memory, governor):
        yield look()


def python() -> Check:
    """Look at the interpreter: 3.11 or later."""
    version, recent = sys.version.split()[0], sys.version_info >= (3, 11)
    return Check(
        name="Python",
        state=OK if recent else MISSING,
        detail=version,
        remedy="" if recent else "install Python 3.11 or later",
        required=True,
    )


def compile_cache() -> Check:
    """Look whether compiled kernels can be kept, so that only the first start is slow."""
    folder = Path(os.environ.get("NUMBA_CACHE_DIR") or Path(monochord.__file__).parent)
    writable = os.access(folder, os.W_OK) or (not folder.exists() and os.access(folder.parent, os.W_OK))
    return Check(
        name="compile cache",
        state=OK if writable else WARN,
        detail=f"{folder}{'' if writable else ' (not writable)'}",
        remedy="" if writable else "set NUMBA_CACHE_DIR to a folder of yours, or each start compiles anew",
    )


def sound_files() -> Check:
    """Look for libsndfile, which reads recordings."""
    try:
        import soundfile  # noqa: PLC0415
    except OSError:
        remedy = "pip install --force-reinstall soundfile, or apt install libsndfile1"
        return Check(name="libsndfile", state=MISSING, detail="none", remedy=remedy, required=True)
    return Check(name="libsndfile", state=OK, detail=soundfile.__libsndfile_version__, required=True)


def jack() -> Check:
    """Look for JACK and its server."""
    try:
        library = jack_library()
    except DeviceError:
        return Check(name="JACK", state=MISSING, detail="no libjack", remedy="apt install jackd2")
    try:
        client = JackClient("monochord-doctor")
    except DeviceError:
        remedy = f"to capture live, {START_SERVER}"
        return Check(name="JACK", state=WARN, detail=f"{library}, no server running", remedy=remedy)
    try:
        rate, period, urgent = client.sample_rate, client.period, client.realtime
    finally:
        client.close()
    server = f"{library}, server at {rate} Hz, {period} frames a period ({1e3 * period / rate:.1f} ms)"
    if not urgent:
        remedy = "start it with -R, or it will lose frames under load"
        return Check(name="JACK", state=WARN, detail=f"{server}, not real-time", remedy=remedy)
    return Check(name="JACK", state=OK, detail=f"{server}, real-time")


def port_audio() -> Check:
    """Look for PortAudio and the sound cards it sees."""
    try:
        import sounddevice  # noqa: PLC0415
    except OSError:
        remedy = "for sound cards without JACK: apt install libportaudio2"
        return Check(name="PortAudio", state=MISSING, detail="none", remedy=remedy)
    inputs = [card["name"] for card in sounddevice.query_devices() if card["max_input_channels"] > 0]
    if not inputs:
        remedy = "for live input plug in a sound card"
        return Check(name="PortAudio", state=WARN, detail="no input device", remedy=remedy)
    return Check(name="PortAudio", state=OK, detail=", ".join(inputs))


def priority() -> Check:
    """Try whether a thread may run with real-time priority, as JACK's do."""
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
    return Check(
        name="real-time priority",
        state=OK if granted else WARN,
        detail="granted" if granted else "refused",
        remedy="" if granted else f"put '@audio - rtprio 95' {LIMITS}",
    )


def memory() -> Check:
    """Try whether memory may be locked against swapping, as JACK's clients do with theirs."""
    libc = ctypes.CDLL(None)
    with mmap.mmap(-1, LOCKED_MEMORY) as block:
        view = ctypes.c_char.from_buffer(block)
        refused = libc.mlock(ctypes.byref(view), ctypes.c_size_t(LOCKED_MEMORY))
        del view  # or the memory could not be given back
    return Check(
        name="locked memory",
        state=WARN if refused else OK,
        detail=f"{LOCKED_MEMORY >> 20} MB {'refused' if refused else 'granted'}",
        remedy=f"put '@audio - memlock unlimited' {LIMITS}" if refused else "",
    )


def governor() -> Check:
    """Look whether the processor keeps its pace."""
    try:
        governor = GOVERNOR.read_text(encoding="ascii").strip()
    except OSError:
        return Check(name="processor pace", state=OK, detail="not reported by this machine")
    slow = governor not in {"performance", "schedutil"}
    remedy = "for steady latency: cpupower frequency-set -g performance" if slow else ""
    return Check(name="processor pace", state=WARN if slow else OK, detail=governor, remedy=remedy)
