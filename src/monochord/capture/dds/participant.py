"""Takes part in a DDS domain: writers and readers of ROS 2 topics."""

import ctypes
import os
import re
import socket
import struct
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from monochord.core.errors import DeviceError, InputError
from monochord.core.units import Seconds

MOST_DOMAIN = 232
DEPTH = 10  # what ROS 2 keeps of a topic
URI = "CYCLONEDDS_URI"
FIRST_PORT, PORTS = 7400, 250
"""A domain's UDP ports after the DDSI standard: from 7400 + 250 times the domain on, so many."""
ATTACH_FILTER = 26  # SO_ATTACH_FILTER of asm-generic/socket.h, which Python does not name
LARGEST_SAMPLE = "1 MiB"
"""Of a larger message nothing is put together, so that none fills the memory."""

Hear = Callable[[Any, Seconds], None]
"""Called with a message and the monotonic time at which it came, in a thread of DDS."""

_CONFIGURING = threading.Lock()


class Participant:
    """One who takes part in a domain, and with it leaves all of its writers and readers.

    Parameters
    ----------
    domain
        Number of the domain; None for ``$ROS_DOMAIN_ID``, or else 0.
    interface
        Network interface to speak over; ``lo`` keeps to this machine, empty lets the library choose.
        ``$CYCLONEDDS_URI`` goes before it where it is set, and a process has one configuration for each
        domain: that of its first participant. CycloneDDS binds its sockets to the wildcard address (``ss``
        shows ``0.0.0.0``); the kernel drops what did not come in over the interface or from this machine.
        Nothing is logged, however much garbage comes, unless the URI asks for it (``Tracing/Verbosity``).

    Raises
    ------
    InputError
        If the domain is none, or there is no library to speak DDS with.
    DeviceError
        If there is no such interface.

    Examples
    --------
    >>> with Participant() as here:
    ...     here.writer("pose", "PoseStamped").listeners
    0
    """

    def __init__(self, *, domain: int | None = None, interface: str = "lo") -> None:
        self.domain = _own_domain() if domain is None else domain
        if not 0 <= self.domain <= MOST_DOMAIN:
            raise InputError(f"DDS domain {self.domain}", f"0 to {MOST_DOMAIN}")
        if not re.fullmatch(r"[\w.:-]*", interface):
            raise InputError(
                f"interface '{interface}'", "the name of a network interface, such as lo or eth0"
            )
        try:
            from cyclonedds.core import DDSException  # noqa: PLC0415
            from cyclonedds.domain import DomainParticipant  # noqa: PLC0415
            from cyclonedds.internal import load_cyclonedds  # noqa: PLC0415
        except ImportError as error:
            lacking = "DDS without the package cyclonedds"
            raise InputError(lacking, "it installed", "pip install 'monochord[ros]'") from error
        # Its Tracing/Verbosity "none" still writes a line to stderr for each malformed packet.
        load_cyclonedds().dds_set_log_mask(0)
        try:
            with _configured(interface) as ours:
                others = _sockets()
                self._participant: Any = DomainParticipant(self.domain)
                if ours and interface:
                    _keep_to(interface, self.domain, _sockets() - others)
        except (DDSException, OSError) as error:
            doubt = "is there such a network?" if not os.environ.get(URI) else f"is ${URI} right?"
            line = f"DDS over '{interface}': the domain {self.domain} cannot be joined; {doubt}"
            raise DeviceError(line) from error
        self._parts: list[Writer | Reader] = []

    def writer(self, topic: str, message: str) -> "Writer":
        """Return what writes messages of a kind of `monochord.capture.dds.messages` to a topic of ROS 2."""
        part = Writer(self._participant, topic, message)
        self._parts.append(part)
        return part

    def reader(self, topic: str, message: str, hear: Hear) -> "Reader":
        """Return what calls `hear` with each message of a topic of ROS 2, until the participant leaves."""
        part = Reader(self._participant, topic, message, hear)
        self._parts.append(part)
        return part

    def close(self) -> None:
        """Leave the domain."""
        for part in self._parts:
            part.close()
        self._parts.clear()
        self._participant = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Writer:
    """Writes messages to a topic, reliably, as ROS 2 does unless told otherwise."""

    def __init__(self, participant: Any, topic: str, message: str) -> None:
        from cyclonedds.core import Policy, Qos  # noqa: PLC0415
        from cyclonedds.pub import DataWriter  # noqa: PLC0415

        self.message, place = _topic(participant, topic, message)
        reliable = Policy.Reliability.Reliable(max_blocking_time=100_000_000)
        told = Policy.Userdata(data=f"typehash={_hash(self.message)};".encode())
        qos = Qos(reliable, Policy.History.KeepLast(depth=DEPTH), told)
        self._writer: Any = DataWriter(participant, place, qos=qos)

    @property
    def listeners(self) -> int:
        """How many readers there are."""
        return len(self._writer.get_matched_subscriptions())

    def write(self, message: Any, nanoseconds: int) -> None:
        """Send a message, with the time since the Unix epoch at which what it says was so."""
        self._writer.write(message, nanoseconds)

    def close(self) -> None:
        """Leave the topic."""
        self._writer = None


class Reader:
    """Hears a topic: from reliable writers and from those that are not, and whatever they keep.

    `faulty` counts the messages that could not be decoded.
    """

    def __init__(self, participant: Any, topic: str, message: str, hear: Hear) -> None:
        from cyclonedds.core import Listener, Policy, Qos  # noqa: PLC0415
        from cyclonedds.sub import DataReader  # noqa: PLC0415

        _, place = _topic(participant, topic, message)
        qos = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(depth=1000))
        self._hear = hear
        self._came = 0
        self.faulty = 0
        self._reader: Any = DataReader(participant, place, qos=qos)
        listener: Any = Listener()
        listener.set_on_data_available(lambda _: self._take(time.monotonic()))
        listener.set_on_subscription_matched(lambda _, status: self._match(status))
        self._reader.set_listener(listener)
        self._came = max(self._came, min(self.writers, 1))  # one may have been met before it listened

    @property
    def writers(self) -> int:
        """How many writers there are."""
        return len(self._reader.get_matched_publications())

    @property
    def returns(self) -> int:
        """How often a writer came after all had gone."""
        return max(0, self._came - 1)

    def close(self) -> None:
        """Leave the topic; when this returns, nothing more is heard."""
        self._reader.set_listener(None)
        self._reader = None

    def _match(self, status: Any) -> None:
        if status.current_count == 1 and status.current_count_change > 0:
            self._came += 1

    def _take(self, now: Seconds) -> None:
        from cyclonedds.core import DDSException  # noqa: PLC0415

        while reader := self._reader:
            # One by one: what cannot be decoded raises, and takes with it all that was taken at once.
            try:
                messages = reader.take(1)
            except DDSException:
                return
            except Exception:  # noqa: BLE001  (a text that is no UTF-8, a sequence that is longer than its message)
                self.faulty += 1
                continue
            if not messages:
                return
            if getattr(messages[0].sample_info, "valid_data", False):
                self._hear(messages[0], now)


def _topic(participant: Any, topic: str, message: str) -> tuple[type[Any], Any]:
    from cyclonedds.topic import Topic  # noqa: PLC0415

    from monochord.capture.dds import messages  # noqa: PLC0415

    kind: type[Any] = getattr(messages, message)
    if not all(part.replace("_", "a").isalnum() for part in topic.strip("/").split("/")):
        raise InputError(f"topic '{topic}'", "letters, digits and _, parted by /")
    return kind, Topic(participant, "rt/" + topic.strip("/"), kind)


def _hash(message: type[Any]) -> str:
    from monochord.capture.dds.messages import TYPE_HASHES, ros_name  # noqa: PLC0415

    return TYPE_HASHES[ros_name(message)]


def _own_domain() -> int:
    text = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not text.isdecimal():
        raise InputError(f"ROS_DOMAIN_ID '{text}'", f"0 to {MOST_DOMAIN}")
    return int(text)


@contextmanager
def _configured(interface: str) -> Generator[bool]:
    """Hand over the configuration by the environment: so the domain ends with its last participant.

    Yields whether it is ours and not that of ``$CYCLONEDDS_URI``.
    """
    alone = interface == "lo"
    discovery = (
        "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>60</MaxAutoParticipantIndex>"
        '<Peers><Peer address="127.0.0.1"/></Peers></Discovery>'
        if alone
        else ""
    )
    multicast = "<AllowMulticast>false</AllowMulticast>" if alone else ""
    card = f'<Interfaces><NetworkInterface name="{interface}"/></Interfaces>' if interface else ""
    bounds = f"<Internal><MaxSampleSize>{LARGEST_SAMPLE}</MaxSampleSize></Internal>"
    with _CONFIGURING:
        if os.environ.get(URI):
            yield False
            return
        os.environ[URI] = (
            f"<CycloneDDS><Domain><General>{card}{multicast}</General>{discovery}{bounds}</Domain></CycloneDDS>"
        )
        try:
            yield True
        finally:
            del os.environ[URI]


def _sockets() -> set[int]:
    """Return the descriptors of this process's sockets."""
    found: set[int] = set()
    for entry in Path("/proc/self/fd").iterdir():
        with suppress(OSError):  # the listing's own is closed by now
            if str(entry.readlink()).startswith("socket:"):
                found.add(int(entry.name))
    return found


def _keep_to(interface: str, domain: int, descriptors: set[int]) -> None:
    """Have the kernel drop what reaches a domain's wildcard sockets over any other interface but ``lo``.

    A classic BPF program (linux/filter.h), which anyone may attach to an own socket: it looks at the index of
    the interface that a packet came in over. What this machine sends to itself comes in over ``lo``, whatever
    address it is sent to, and nothing from outside does.
    """
    load_word, equal, give = 0x20, 0x15, 0x06  # BPF_LD|BPF_W|BPF_ABS, BPF_JMP|BPF_JEQ|BPF_K, BPF_RET|BPF_K
    came_in_over = 0xFFFFF008  # SKF_AD_OFF + SKF_AD_IFINDEX
    program = (
        (load_word, 0, 0, came_in_over),
        (equal, 2, 0, socket.if_nametoindex(interface)),
        (equal, 1, 0, socket.if_nametoindex("lo")),
        (give, 0, 0, 0),
        (give, 0, 0, 0xFFFFFFFF),
    )
    code = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *step) for step in program))
    filter_ = struct.pack("@HP", len(program), ctypes.addressof(code))
    first = FIRST_PORT + PORTS * domain
    for descriptor in descriptors:
        with socket.socket(fileno=os.dup(descriptor)) as sock:
            if (sock.family, sock.type) != (socket.AF_INET, socket.SOCK_DGRAM):
                continue
            host, port = sock.getsockname()
            if host == "0.0.0.0" and first <= port < first + PORTS:  # noqa: S104  (looked for, not bound)
                sock.setsockopt(socket.SOL_SOCKET, ATTACH_FILTER, filter_)
