"""Touch and slip events: onset and end of contact, onset and end of sliding."""

from dataclasses import dataclass

from monochord.core.units import Seconds
from monochord.live.filter import CONTACT, SLIP, FilterState, Tracked
from monochord.live.switches import Switch


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A change of a decision about a touch.

    `name` is the quantity, ``contact`` or ``slip``, and `on` its new state. `time` is the onset in seconds
    since the stream began: the end of the first window that showed the change; `adc_time` is the same on the
    monotonic clock, where the source knows it. The change was decided `delay` later, at the end of a later
    window, with probability `confidence`.

    >>> Event(name="contact", on=True, time=1.25, delay=0.03, confidence=0.98).decided
    1.28
    """

    name: str
    on: bool
    time: Seconds
    delay: Seconds
    confidence: float
    adc_time: Seconds | None = None

    @property
    def kind(self) -> str:
        """The event in one word: ``contact_begins``, ``slip_ends`` and so on."""
        return f"{self.name}_{'begins' if self.on else 'ends'}"

    @property
    def decided(self) -> Seconds:
        """When the event was decided: the end of that window, in seconds since the stream began."""
        return self.time + self.delay


@dataclass(frozen=True, slots=True, kw_only=True)
class AnnouncedState:
    """The state announced by the events so far, passed in and out; it starts as ``AnnouncedState()``.

    It stays unchanged while nothing is decided, as in a long gap.
    """

    contact: bool = False
    slip: bool = False


def step(
    before: AnnouncedState, state: FilterState, tracked: Tracked, adc_offset: Seconds | None = None
) -> tuple[AnnouncedState, tuple[Event, ...]]:
    """Return the announced state after a window, and its events: the end of slip before that of contact.

    `state` and `tracked` are the filter's after the window. `adc_offset` is the monotonic clock minus the
    stream's time at the converter, in s, where the source knows it.

    Examples
    --------
    >>> from monochord.live.switches import Switch
    >>> contact = Switch(on=True, since=0.5, decided=0.52, level=4.0, time=0.52)
    >>> state, tracked = FilterState(time=0.52, contact=contact), Tracked(decided={"contact": True})
    >>> _, events = step(AnnouncedState(), state, tracked)
    >>> [(event.name, event.on, event.time, round(event.delay, 3)) for event in events]
    [('contact', True, 0.5, 0.02)]
    """
    contact, slip = tracked.decided.get(CONTACT, before.contact), tracked.decided.get(SLIP, before.slip)
    if contact == before.contact and slip == before.slip:
        return before, ()
    changes = list[Event]()
    if contact != before.contact:
        changes.append(_event(CONTACT, state.contact, adc_offset, on=contact))
    if slip != before.slip:
        # Where the touch has ended, so has its slip.
        source = state.slip if state.slip.on is slip else state.contact
        changes.append(_event(SLIP, source, adc_offset, on=slip))
    if not contact:
        changes.reverse()
    return AnnouncedState(contact=contact, slip=slip), tuple(changes)


def _event(name: str, source: Switch, adc_offset: Seconds | None, *, on: bool) -> Event:
    probability = source.probability
    return Event(
        name=name,
        on=on,
        time=source.since,
        delay=source.time - source.since,
        confidence=probability if on else 1.0 - probability,
        adc_time=None if adc_offset is None else source.since + adc_offset,
    )
