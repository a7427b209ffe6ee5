"""A sensor that somebody has built from a box of parts: the twin of an unknown build, as a JACK sound card.

    python -m tests.e2e.box_of_parts SERVER BUILD DAY

Each line of standard input is carried out, and answered on standard output: ``step NAME`` does what a step of
the bring-up asks for, from when the ports are next connected; ``on`` switches the drivers on and leaves the
string alone; ``press MM NEWTONS`` and ``release``. The first line is ``ready`` and the string's length in m
as a ruler says it.
"""

import queue
import sys
import threading

import numpy as np

from monochord.bringup import STEPS, Virtual
from monochord.capture.jack import arena as at
from monochord.capture.jack import libjack
from monochord.capture.jack.arena import Arena
from monochord.capture.jack.client import JackClient
from monochord.core.errors import InputError
from monochord.core.priority import before_other_programs
from monochord.core.types import Audio
from monochord.core.units import Metres
from monochord.lab.jack_twin import RING, Relay
from monochord.physics.twin.virtual_sensor import VirtualSensor

RATE = 44100
BLOCK = 512
WORLD = "plausible"
SPARE = 2.0
"""Time in s that a step's sound goes on after its end, in case the recording begins late."""


class Card(Relay):
    """The relay with ports like those of a sound card."""

    def __init__(self, server: str) -> None:
        self._ring = Arena(2, RING, periods=0)
        self._client = JackClient("card", server)
        from monochord.capture.jack import callbacks  # compiled by now

        flags = libjack.IS_OUTPUT | libjack.IS_PHYSICAL
        self.ports = self._client.start(self._ring, callbacks.relay.address, flags, "capture")
        self._written = 0

    @property
    def begun(self) -> bool:
        """Whether the ports have been connected."""
        return self._ring.count(at.READ) > 0


class Box:
    """The sensor: what is done to it is asked for in another thread than its sound is played in."""

    def __init__(self, server: str, build: int, day: int) -> None:
        self._server, self._build, self._day = server, build, day
        self._twin = VirtualSensor("prototype_ebow", seed=build, build=build, day=day, world=WORLD)
        self._virtual = Virtual(sensor=self._twin.sensor, seed=build)
        self._steps = {step.name: self._step(step.name) for step in STEPS}
        self.asked: queue.SimpleQueue[str] = queue.SimpleQueue()

    @property
    def length(self) -> Metres:
        """The string's length as measured with a ruler, in m."""
        return self._twin.sensor.measured_length or self._twin.sensor.string.length

    def _step(self, name: str) -> Audio:
        step = next(each for each in STEPS if each.name == name)
        sound = self._virtual.take(step).samples
        return np.concatenate([sound, np.zeros((2, round(SPARE * RATE)), np.float32)], axis=1)

    def play(self) -> None:
        """Play until the process ends."""
        asked, card = self.asked.get(), None
        while True:
            if card is not None:
                card.close()
            card = Card(self._server)
            answer(asked)
            asked = self._live(card) if asked == "on" else self._take(card, asked.removeprefix("step "))

    def _take(self, card: Card, name: str) -> str:
        sound = self._steps[name]
        for first in range(0, sound.shape[1], BLOCK):
            card.write(sound[:, first : first + BLOCK])
        return self.asked.get()

    def _live(self, card: Card) -> str:
        twin = self._twin
        while True:
            while not self.asked.empty():
                asked = self.asked.get()
                match asked.split():
                    case ["press", place, force]:
                        try:
                            twin.press(1e-3 * float(place), float(force), material="plastic")
                        except InputError as error:
                            answer(f"refused: {error}")
                            continue
                    case ["release"]:
                        twin.release()
                    case _:
                        return asked
                answer(asked)
            card.write(twin.advance(BLOCK / RATE)[0])


def answer(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def main(server: str, build: str, day: str) -> None:
    with before_other_programs():
        box = Box(server, int(build), int(day))
        answer(f"ready {box.length:.4f}")
        threading.Thread(target=box.play, daemon=True).start()
        for line in sys.stdin:
            box.asked.put(line.strip())


if __name__ == "__main__":
    main(*sys.argv[1:])
