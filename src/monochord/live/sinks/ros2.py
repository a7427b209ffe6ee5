"""ROS 2 topics over DDS, without a ROS installation."""

import time
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from monochord.core.errors import InputError
from monochord.core.units import Metres, Seconds
from monochord.live.sinks._record import unix_nanoseconds
from monochord.live.sinks._ros_messages import Answer, Values, event, messages
from monochord.live.sinks._ros_scene import Pose, markers, transform
from monochord.live.sinks.base import NEWEST, NotDeliveredError, Run, Sink, Update, Writer
from monochord.live.sinks.terminal import DEFAULT_LENGTH
from monochord.sessions.codec import encode, header, typestore
from monochord.sessions.packing import pack

if TYPE_CHECKING:
    from monochord.capture.dds.participant import Participant, TopicWriter

DIAGNOSTICS_INTERVAL: Seconds = 1.0
"""Time between diagnostics messages, in s."""
MARKERS_INTERVAL: Seconds = 0.1
"""Time between messages of markers, in s."""
LEVELS = {"info": 0, "warning": 1, "error": 2}
"""Diagnostic level of a note: OK, WARN, ERROR."""
TOPICS = {
    "touch": "PointStamped",
    "wrench": "WrenchStamped",
    "contact": "Bool",
    "slip": "Bool",
    "estimates": "Touch",
    "events": "Event",
}
"""Messages by topic, below the namespace."""
NAME = "monochord"
"""Name of the node, and of the hardware, where the namespace is empty."""
IN_PLACE: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NO_POSES: Mapping[str, Pose] = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True)
class Ros2(Sink):
    """Publish ROS 2 topics, one message per window; needs the extra ``ros``, but no ROS installation.

    Below the namespace: ``contact`` and ``slip``, ``std_msgs/Bool``; ``touch``,
    ``geometry_msgs/PointStamped``, whose x is the position from pickup 1 along the string in m; ``wrench``,
    ``geometry_msgs/WrenchStamped``, whose force z is the normal force F on the object in N, and whose torque
    in N m is about pickup 1, (0, -x F, 0) for a touch at x (0 without contact, NaN where the position is
    withheld); and ``estimates``, ``monochord_msgs/Touch``, with all estimates, standard errors,
    validity and reasons. A standard topic is silent for a window without an estimate of its quantity.
    ``events``, ``monochord_msgs/Event``, has a message when contact or slip begins or ends, stamped with the
    onset; its data hold the decision's delay in s and its confidence. Once a second, ``/diagnostics``,
    ``diagnostic_msgs/DiagnosticArray``, has the health notes, latencies and counters.

    For RViz, ``markers``, ``visualization_msgs/MarkerArray``, shows all strings with touch, force and text 10
    times a second: a string is dimmed while its position is withheld, a touch while its force is. The latched
    topic ``/tf_static`` has the frame of each string on its link.

    The stamp of every other header is the time at which the window's last sample was at the converter (or
    became available, where the source does not know), on the system clock. Publishing is reliable and keeps
    the last 10 messages; a stalled or lost subscriber delays nothing, and a topic without one is not written.
    One node, seen by ``ros2 node list``, has all topics.

    Parameters
    ----------
    namespace
        Prefix of the topics; with several strings, each string's name follows it, except for ``markers``.
    frame
        Frame of points and wrenches: x along the string from pickup 1, z away from the string towards the
        object. With several strings, each string's name precedes it, as in ``left_string``.
    domain
        DDS domain; None for ``$ROS_DOMAIN_ID``, or else 0.
    interface
        Network interface; ``lo`` is this machine alone, empty lets the library choose. Anyone on that network
        can read the topics.
    tracked
        Whether the standard topics carry the tracked values where known; else those of each window alone.
    node
        Full name of the node; empty for the namespace.
    link
        Frame of the robot's part that carries the strings. Empty for one link of each string, named after its
        frame, as in ``string_link``.
    poses
        Pose of a string in its link by the name of its frame: x, y, z in m, roll, pitch, yaw in rad as in
        URDF. Without one, the frame lies in its link; several strings on one link need one each.
    tf
        Whether to publish ``/tf_static``; false where the robot's description has the strings' frames.

    Examples
    --------
    >>> from monochord.core.types import Signal
    >>> poses = {"string": (0.1, 0.0, 0.02, 0.0, 0.0, 1.5708)}
    >>> sink = Ros2(namespace="/left_string", link="finger", poses=poses)
    >>> with sink.open(Run(signal=Signal(sample_rate=44100, channels=2))):
    ...     pass
    """

    namespace: str = "/monochord"
    frame: str = "string"
    domain: int | None = None
    interface: str = "lo"
    tracked: bool = True
    node: str = ""
    link: str = ""
    poses: Mapping[str, Pose] = field(default_factory=lambda: NO_POSES)
    tf: bool = True

    @property
    def backlog(self) -> int:
        """0.1 s of windows: a robot controller needs the newest ones."""
        return NEWEST

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:
        """Join the domain; raises `InputError` without the library, `DeviceError` without the network.

        Raises `InputError`, too, for a pose of a frame that does not exist, or without one that it needs.
        """
        from monochord.capture.dds.participant import Participant  # noqa: PLC0415

        place, frames = self.namespace.strip("/"), self._frames(run)
        self._refuse_poses(frames)
        with Participant(domain=self.domain, interface=self.interface) as participant:
            writer = _Publisher(self, place, run, frames, participant)
            participant.announce(self.node.strip("/") or place or NAME)
            yield writer

    def _frames(self, run: Run) -> dict[str, str]:
        """Return the frame of each string."""
        return {name: f"{name}_{self.frame}" if name else self.frame for name in run.strings or [run.string]}

    def _refuse_poses(self, frames: Mapping[str, str]) -> None:
        known = list(frames.values())
        for frame in self.poses:
            if frame not in known:
                raise InputError(f"pose of the frame '{frame}'", f"one of {', '.join(known)}")
        missing = [frame for frame in known if frame not in self.poses]
        if self.tf and self.link and len(known) > 1 and missing:
            given = f"no pose of {', '.join(missing)} in the link '{self.link}'"
            raise InputError(given, "one for each string", "set sinks.ros2.poses, or leave the link out")
        if self.tf and self.link in known:
            raise InputError(f"link '{self.link}'", "another name than that of a string's frame")


class _Publisher(Writer):
    """Writes the topics of all strings, from one thread through one participant."""

    def __init__(
        self, options: Ros2, place: str, run: Run, frames: Mapping[str, str], participant: "Participant"
    ) -> None:
        from cyclonedds.core import DDSException  # noqa: PLC0415

        self._failure = DDSException
        diagnostics = participant.writer("/diagnostics", "DiagnosticArray")
        self._markers = participant.writer(f"{place}/markers", "MarkerArray")
        self._due: Seconds = 0.0
        self._strings: dict[str, _String] = {}
        for name, frame in frames.items():
            signal = run.strings.get(name, run.signal)
            known = signal.string.length if signal.string else DEFAULT_LENGTH
            below = f"{place}/{name}".strip("/")
            self._strings[name] = _String(
                below, frame, run.length or known, participant, diagnostics, tracked=options.tracked
            )
        if options.tf:
            self._transforms = participant.writer("/tf_static", "TFMessage", latched=True)
            now = time.time_ns()
            transforms = [
                transform(options.poses.get(frame, IN_PLACE), options.link or f"{frame}_link", frame, now)
                for frame in frames.values()
            ]
            self._transforms.send(encode(self._transforms.name, transforms=transforms), now)

    def write(self, update: Update) -> None:
        stamp = unix_nanoseconds(update)
        try:
            self._strings[update.string].write(update, stamp)
            if self._markers.is_read and time.monotonic() >= self._due:
                self._due = time.monotonic() + MARKERS_INTERVAL
                shown = [each for string in self._strings.values() for each in string.markers()]
                self._markers.send(encode(self._markers.name, markers=shown), stamp)
        except self._failure as error:  # a subscriber that takes none for too long
            raise NotDeliveredError from error


class _String:
    """The topics of one string."""

    def __init__(
        self,
        place: str,
        frame: str,
        length: Metres,
        participant: "Participant",
        diagnostics: "TopicWriter",
        *,
        tracked: bool,
    ) -> None:
        self._place, self._frame, self._length, self._tracked = place, frame, length, tracked
        self._writers = {
            topic: participant.writer(f"{place}/{topic}", message) for topic, message in TOPICS.items()
        }
        self._diagnostics = diagnostics
        self._newest: tuple[Answer, int] | None = None
        self._latencies: list[Seconds] = []
        self._windows = 0
        self._next: Seconds = 0.0

    def write(self, update: Update, stamp: int) -> None:
        """Write a window's messages to the topics that are read."""
        self._windows += 1
        self._latencies.append(update.prediction.latency)
        answer = Answer.of(update, tracked=self._tracked)
        self._newest = answer, stamp
        for topic, values in messages(update, answer, stamp, self._frame):
            self._send(topic, values, stamp)
        for each in update.events:
            onset, values = event(each, update, stamp, self._frame)
            self._send("events", values, onset)
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + DIAGNOSTICS_INTERVAL
            status = self._status(update)
            data = encode(self._diagnostics.name, header=header(stamp), status=[status])
            self._diagnostics.send(data, stamp)

    def markers(self) -> list[Any]:
        """Return the markers of the newest window; none before the first."""
        if self._newest is None:
            return []
        answer, stamp = self._newest
        return markers(answer, self._length, self._frame, stamp)

    def _send(self, topic: str, values: Values, stamp: int) -> None:
        writer = self._writers[topic]
        if writer.is_read:
            writer.send(pack(writer.name, *values), stamp)

    def _status(self, update: Update) -> Any:
        types = typestore().types
        ordered, health = sorted(self._latencies), update.health
        self._latencies = []
        values = {
            "windows": self._windows,
            "skipped": update.skipped,
            "latency median in ms": f"{1e3 * ordered[len(ordered) // 2]:.2f}",
            "latency 99 % in ms": f"{1e3 * ordered[int(0.99 * len(ordered))]:.2f}",
            "gaps": health.gaps,
            "dropped": health.dropped,
            "xruns": health.xruns,
            "reconnects": health.reconnects,
            **{note.key: f"{note.sentence} {note.remedy}".strip() for note in update.notes},
        }
        level = max((LEVELS[note.level] for note in update.notes), default=0)
        worst = [note.sentence for note in update.notes if LEVELS[note.level] == level]
        pair = types["diagnostic_msgs/msg/KeyValue"]
        return types["diagnostic_msgs/msg/DiagnosticStatus"](
            level=level,
            name=f"{self._place or NAME}: sensor",
            message=" ".join(worst) or "OK",
            hardware_id=self._place,
            values=[pair(key=key, value=str(value)) for key, value in values.items()],
        )
