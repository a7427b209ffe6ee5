"""ROS 2 topics over DDS, without a ROS installation."""

import json
import time
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from monochord.core.reasons import Reason
from monochord.core.types import Estimate
from monochord.core.units import Seconds
from monochord.live.events import Event
from monochord.live.sinks._record import NANO, unix_nanoseconds
from monochord.live.sinks.base import NEWEST, NotDeliveredError, Run, Sink, Update, Writer
from monochord.sessions.codec import nanoseconds

if TYPE_CHECKING:
    from monochord.capture.dds.participant import Participant

DIAGNOSTICS_INTERVAL: Seconds = 1.0
"""Time between diagnostics messages, in s."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Ros2(Sink):
    """Publish ROS 2 topics, one message per window; needs the extra ``ros``, but no ROS installation.

    Below the namespace: ``contact`` and ``slip``, ``std_msgs/Bool``; ``touch``,
    ``geometry_msgs/PointStamped``, whose x is the position from pickup 1 along the string in m; ``wrench``,
    ``geometry_msgs/WrenchStamped``, whose force z is the normal force on the object in N, 0 without contact;
    and ``estimates``, ``monochord_msgs/Touch``, with all estimates, standard errors, validity and reasons. A
    standard topic is silent for a window without an estimate of its quantity. ``events``,
    ``monochord_msgs/Event``, has a message when contact or slip begins or ends, stamped with the onset; its
    data hold the decision's delay in s and its confidence. Once a second, ``/diagnostics``,
    ``diagnostic_msgs/DiagnosticArray``, has the health notes, latencies and counters.

    The stamp of every other header is the time at which the window's last sample was at the converter (or
    became available, where the source does not know), on the system clock. Publishing is reliable and keeps
    the last 10 messages; a stalled or lost subscriber delays nothing. The topics appear in ``ros2 topic
    list``, but no node appears in ``ros2 node list``.

    Parameters
    ----------
    namespace
        Prefix of the topics; with several strings, each string's name follows it.
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

    Examples
    --------
    >>> from monochord.core.types import Signal
    >>> with Ros2(namespace="/left_string").open(Run(signal=Signal(sample_rate=44100, channels=2))):
    ...     pass
    """

    namespace: str = "/monochord"
    frame: str = "string"
    domain: int | None = None
    interface: str = "lo"
    tracked: bool = True

    @property
    def backlog(self) -> int:
        """0.1 s of windows: a robot controller needs the newest ones."""
        return NEWEST

    @property
    def is_for_each_string(self) -> bool:
        """True: each string has a separate namespace and frame."""
        return True

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:
        """Join the domain; raises `InputError` without the library, `DeviceError` without the network."""
        from monochord.capture.dds.participant import Participant  # noqa: PLC0415

        place, options = self.namespace.rstrip("/"), self
        if run.string:
            options = replace(self, namespace=f"{place}/{run.string}", frame=f"{run.string}_{self.frame}")
        with Participant(domain=self.domain, interface=self.interface) as participant:
            yield _Topics(options, participant)


class _Topics(Writer):
    def __init__(self, options: Ros2, participant: "Participant") -> None:
        place = options.namespace.strip("/")
        self._options, self._hardware = options, place
        self._writers = {
            topic: participant.writer(f"{place}/{topic}", message) for topic, message in TOPICS.items()
        }
        self._diagnostics = participant.writer("/diagnostics", "DiagnosticArray")
        self._latencies: list[Seconds] = []
        self._windows = 0
        self._next: Seconds = 0.0

    def write(self, update: Update) -> None:
        from cyclonedds.core import DDSException  # noqa: PLC0415

        self._windows += 1
        self._latencies.append(update.prediction.latency)
        stamp = unix_nanoseconds(update)
        try:
            for topic, message in self._messages(update, stamp).items():
                self._writers[topic].write(message, stamp)
            for event in update.events:
                message = self._event(event, update, stamp)
                self._writers["events"].write(message, nanoseconds(message.header.stamp))
            if time.monotonic() >= self._next:
                self._next = time.monotonic() + DIAGNOSTICS_INTERVAL
                self._diagnostics.write(self._diagnostics_message(update, stamp), stamp)
        except DDSException as error:  # a subscriber that takes none for too long
            raise NotDeliveredError from error

    def _messages(self, update: Update, stamp: int) -> dict[str, Any]:
        """Return the messages of a window by topic."""
        from monochord.capture.dds import messages as ros  # noqa: PLC0415

        tracked = self._options.tracked
        header = ros.header(stamp, self._options.frame)
        contact, slip = (_decision(update, name, tracked=tracked) for name in ("contact", "slip"))
        position, force = (_newest(update, name, tracked=tracked) for name in ("position", "force"))
        messages: dict[str, Any] = {"estimates": _touch(update, header)}
        if contact is not None:
            messages["contact"] = ros.Bool(data=contact)
        if slip is not None or contact is False:
            messages["slip"] = ros.Bool(data=bool(slip) and contact is not False)
        if position.valid and contact is not False:
            point = ros.Point(float(position.value), 0.0, 0.0)
            messages["touch"] = ros.PointStamped(header=header, point=point)
        if force.valid or contact is False:
            newtons = 0.0 if contact is False else float(force.value)
            nothing = ros.Vector3(0.0, 0.0, 0.0)
            wrench = ros.Wrench(force=ros.Vector3(0.0, 0.0, newtons), torque=nothing)
            messages["wrench"] = ros.WrenchStamped(header=header, wrench=wrench)
        return messages

    def _event(self, event: Event, update: Update, stamp: int) -> Any:
        """Return an event's message, stamped with its onset."""
        from monochord.capture.dds import messages as ros  # noqa: PLC0415

        before = update.prediction.time + update.window.duration - event.time
        return ros.Event(
            header=ros.header(stamp - round(before * NANO), self._options.frame),
            kind=event.kind,
            text="",
            data=json.dumps({"delay": event.delay, "confidence": event.confidence}),
        )

    def _diagnostics_message(self, update: Update, stamp: int) -> Any:
        from monochord.capture.dds import messages as ros  # noqa: PLC0415

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
        status = ros.DiagnosticStatus(
            level=level,
            name=f"{self._hardware or 'monochord'}: sensor",
            message=" ".join(worst) or "OK",
            hardware_id=self._hardware,
            values=[ros.KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )
        return ros.DiagnosticArray(header=ros.header(stamp, ""), status=[status])


def _touch(update: Update, header: Any) -> Any:
    from monochord.capture.dds import messages as ros  # noqa: PLC0415

    decided = {None: -1, False: 0, True: 1}
    raw = {
        name: _plain(update.prediction.estimate(name)) for name in ("contact", "position", "force", "slip")
    }
    unknown = Estimate.abstain("", Reason.NOT_TRACKED)
    return ros.Touch(
        header=header,
        start=update.prediction.start,
        window=update.window.duration,
        latency=float(update.prediction.latency),
        **raw,
        touched=decided[update.decided.get("contact")],
        slides=decided[update.decided.get("slip")],
        tracked_position=_plain(update.tracked.get("position", unknown)),
        tracked_force=_plain(update.tracked.get("force", unknown)),
    )


def _plain(estimate: Estimate) -> Any:
    from monochord.capture.dds import messages as ros  # noqa: PLC0415

    return ros.Estimate(
        value=float(estimate.value),
        std=float(estimate.std),
        valid=bool(estimate.valid),
        why_not=estimate.reason,
    )


def _newest(update: Update, name: str, *, tracked: bool) -> Estimate:
    """Return the tracked estimate, or else the window's."""
    followed = update.tracked.get(name) if tracked else None
    return followed if followed and followed.valid else update.prediction.estimate(name)


def _decision(update: Update, name: str, *, tracked: bool) -> bool | None:
    """Return the decision over time, or else the window's more likely value; None where unknown."""
    decided = update.decided.get(name) if tracked else None
    probability = update.prediction.estimate(name)
    if decided is not None or not probability.valid:
        return decided
    return bool(probability.value >= 0.5)
