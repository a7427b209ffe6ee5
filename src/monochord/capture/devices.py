"""Audio inputs of this machine: sound cards, and ports of a running JACK server."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass

from monochord.core.errors import DeviceError


@dataclass(frozen=True, slots=True, kw_only=True)
class Device:
    """An audio input of this machine.

    `name` is the value for ``--device`` with the source `source`; `summary` describes the input. `is_default`
    marks the input that is opened without a name.
    """

    source: str
    name: str
    summary: str
    is_default: bool = False


def devices() -> list[Device]:
    """Return the inputs of all sound cards, then those of the default JACK server, possibly none.

    >>> {device.source for device in devices()} <= {"soundcard", "jack"}
    True
    """
    return [*_sound_cards(), *_jack_ports()]


def _sound_cards() -> Iterator[Device]:
    try:
        import sounddevice  # noqa: PLC0415
    except OSError:  # no PortAudio
        return
    default = sounddevice.default.device[0]
    for number, card in enumerate(sounddevice.query_devices()):
        if card["max_input_channels"] > 0:
            summary = f"{card['max_input_channels']} channels, {card['default_samplerate']:.0f} Hz"
            yield Device(source="soundcard", name=card["name"], summary=summary, is_default=number == default)


def _jack_ports() -> Iterator[Device]:
    from monochord.capture.jack.client import JackClient  # noqa: PLC0415
    from monochord.capture.jack.libjack import shown  # noqa: PLC0415

    try:
        client = JackClient("monochord-list")
    except DeviceError:  # no libjack, or no server
        return
    with closing(client):
        default = client.outputs(physical=True)[:2]
        for name in client.outputs():
            summary = f"port, {client.sample_rate} Hz"
            yield Device(source="jack", name=shown(name), summary=summary, is_default=name in default)
