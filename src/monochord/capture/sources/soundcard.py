"""Capture from a sound card through PortAudio, for machines without JACK."""

from collections.abc import Generator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from monochord.capture.sources.base import Source, refuse_other_channels, refuse_other_rates
from monochord.core.errors import DeviceError
from monochord.core.ranges import Count

if TYPE_CHECKING:
    from monochord.capture.sources._soundcard_stream import SoundcardStream

NO_CARD = "connect one, or use the source jack or wav"


@dataclass(frozen=True, slots=True, kw_only=True)
class Soundcard(Source):
    """A sound card's input.

    PortAudio's callback runs in Python: it only copies into a ring of two seconds, yet it waits for the
    interpreter lock, so a busy program loses frames (and reports them). Where every frame counts, use the
    source ``jack``.

    Parameters
    ----------
    device
        Name, part of the name, or number of the input device; empty for the default.
    sample_rate
        Frames a second.
    channels
        Inputs to capture: 1 or 2, or up to 64 for several strings.
    block
        Frames a block.
    """

    device: str = ""
    sample_rate: int = 44100
    channels: int = 2
    block: Count = 256

    @contextmanager
    def open(self) -> Generator["SoundcardStream"]:
        """Open and start the device; raises `DeviceError` where PortAudio or the input is missing."""
        refuse_other_rates(self.sample_rate, "sound card", "set sample_rate=44100")
        refuse_other_channels(self.channels)
        # Imported here: both fail, or take long, where this source is not used.
        from monochord.capture.sources._soundcard_stream import SoundcardStream  # noqa: PLC0415

        with (
            SoundcardStream(self.sample_rate, self.channels) as stream,
            closing(self._start(stream)) as device,
        ):
            stream.watch(lambda: device.active)
            yield stream

    def _start(self, stream: "SoundcardStream") -> Any:
        try:
            import sounddevice  # noqa: PLC0415
        except OSError as error:
            raise DeviceError(
                "PortAudio: not found; install it (Debian: apt install libportaudio2)"
            ) from error
        inputs = [card["name"] for card in sounddevice.query_devices() if card["max_input_channels"] > 0]
        if not inputs:
            raise DeviceError(f"sound card: no input device found; {NO_CARD}")
        named = int(self.device) if self.device.isdecimal() else self.device or None
        try:
            card = sounddevice.InputStream(
                device=named,
                samplerate=self.sample_rate,
                channels=self.channels,
                blocksize=self.block,
                dtype="float32",
                latency="low",
                callback=stream.capture,
            )
            try:
                card.start()
            except BaseException:
                card.close()
                raise
        except (ValueError, sounddevice.PortAudioError) as error:
            there = ", ".join(inputs)
            raise DeviceError(
                f"sound card '{self.device or 'default'}': {error}; there are {there}"
            ) from error
        return card
