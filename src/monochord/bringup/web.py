"""The page of a bring-up: what to do, the levels, and the checks, in any number of browsers."""

import asyncio
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Literal, Protocol

import msgspec
import numpy as np
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route

from monochord.bringup.drawing import drawing
from monochord.bringup.examine import BringUp, number
from monochord.bringup.page import page as report
from monochord.bringup.run import END, RECORD, SKIP, Guide, TakeSource
from monochord.bringup.steps import Step
from monochord.bringup.takes import Virtual
from monochord.core.errors import MonochordError
from monochord.core.types import Audio
from monochord.core.units import Seconds
from monochord.dsp.levels import LOUD_LEVEL, levels
from monochord.page.clients import Clients, Feed, Viewer
from monochord.page.commands import Commands, RefusedError
from monochord.page.messages import number as finite
from monochord.page.messages import packed
from monochord.page.server import Page, static
from monochord.physics.sensors import load_sensor

METERED: Seconds = 0.05
"""Length of sound behind each level of the meter, in s."""
RETRY: Seconds = 1.0
"""Pause before a device that cannot be opened is tried again, in s."""
REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
"""What a report may do: it has its own styles, and no script."""


class Choice(msgspec.Struct, forbid_unknown_fields=True):
    """What a page chooses. `step` is the step that it shows, or the one to go to."""

    do: Literal["record", "skip", "repeat", "end"]
    step: str = ""


class ListenableSource(TakeSource, Protocol):
    """A source that can be listened to between the steps."""

    def listen(self, ended: threading.Event) -> None:
        """Pass on the audio until an event; return at once where there is none."""
        ...


class BringUpPage(Feed):
    """The state that all pages of a bring-up show, and what they choose; called from any thread.

    `write` writes the files once the last step is done, and returns their paths; None for no files.
    """

    def __init__(
        self,
        sensor: str,
        steps: Sequence[Step],
        *,
        write: Callable[[BringUp], Sequence[Path | None]] | None = None,
    ) -> None:
        self._steps, self._sensor, self._write = tuple(steps), sensor, write
        self._choices: SimpleQueue[str] = SimpleQueue()
        self._lock = threading.Lock()
        self._phase: Literal["ready", "recording", "done"] = "ready"
        self._step: Step | None = None
        self._result: BringUp | None = None
        self._skipped: set[str] = set()
        self._error = self._silence = ""
        self._simulated = False
        self._paths = list[str]()
        self._number = 0
        self._sound, self._seconds, self._levels = list[Audio](), 0.0, list[tuple[float, float]]()
        self.commands = Commands({Choice: self._choose}, "a JSON object with do and step")
        self.state_text = self.meter_text = ""
        self._encoded = -1
        self.page = self._page()

    def guide(self, source: ListenableSource) -> Guide:
        """Return the guide that asks this page; it listens to the source while it waits."""
        self._simulated = isinstance(source, Virtual)
        return _PageGuide(self, source)

    def on_audio(self, samples: Audio, sample_rate: int) -> None:
        """Take sound for the meter."""
        if self._silence:
            self.say_silent("")
        self._sound.append(samples)
        if sum(each.shape[1] for each in self._sound) < METERED * sample_rate:
            return
        sound = np.concatenate(self._sound, axis=1)
        self._sound.clear()
        self._levels = [levels(row) for row in sound]
        self._seconds += sound.shape[1] / sample_rate

    def ask(self, step: Step | None, result: BringUp | None) -> str:
        """Show the next step, and return what a page chooses."""
        with self._lock:
            self._phase, self._step = "ready" if step else "done", step
            self._number += 1
        try:
            choice = self._choices.get()
        except KeyboardInterrupt:
            if step is None and result is not None:  # all is done, and Control-C ends the page
                return END
            raise
        with self._lock:
            self._error, self._seconds = "", 0.0
            self._phase = "recording" if choice == RECORD else self._phase
            if step and choice in (RECORD, SKIP):
                (self._skipped.add if choice == SKIP else self._skipped.discard)(step.name)
            self._number += 1
        return choice

    def show(self, result: BringUp) -> None:
        """Show the bring-up of the steps so far."""
        with self._lock:
            self._result = result
            self._number += 1

    def save(self) -> None:
        """Write the files of the bring-up so far; a folder that is gone or full is said on the page."""
        if self._write is not None and self._result is not None:
            try:
                paths = self._write(self._result)
            except MonochordError as error:
                self.say(error)
                return
            with self._lock:
                self._paths = [str(path) for path in paths if path is not None]
                self._number += 1

    def say(self, error: MonochordError) -> None:
        """Show an error, until the next choice."""
        with self._lock:
            self._error = " ".join(str(error).split())
            self._number += 1

    def say_silent(self, why: str) -> None:
        """Show why there is no sound, until there is."""
        with self._lock:
            if why != self._silence:
                self._silence = " ".join(why.split())
                self._number += 1

    def _choose(self, choice: Choice) -> bool:
        """Pass a page's choice to who asks; raises `RefusedError` where it cannot be made now."""
        with self._lock:
            if why := self._refusal(choice):
                raise RefusedError(why)
            choices = {"record": RECORD, "skip": SKIP, "end": END, "repeat": choice.step}
            self._choices.put(choices[choice.do])
        return True

    def _refusal(self, choice: Choice) -> str:
        """Return why a choice cannot be made now; empty where it can."""
        current = self._step.name if self._step else None
        if self._phase == "recording" or not self._choices.empty():
            return "A step is being recorded. Wait until it ends."
        if choice.do == "repeat":
            names = [each.name for each in self._steps]
            return "" if choice.step in names else f"Step '{choice.step}': expected {', '.join(names)}."
        if current is None:
            return "All steps are done."
        return "" if choice.do == "end" or choice.step == current else "Another page has gone on meanwhile."

    def state(self) -> tuple[int, dict[str, Any]]:
        """Return everything but the meter, and a number that changes with it."""
        with self._lock:
            result, step = self._result, self._step
            known = {*result.takes, "loopback"} if result else set[str]()
            checks = [check for check in result.checks if check.step in known] if result else []
            failed = {check.step for check in checks if check.passed is False}
            taken = set(result.takes) if result else set[str]()
            status = {
                each.name: "failed" if each.name in failed & taken
                else "passed" if each.name in taken
                else "skipped" if each.name in self._skipped
                else "waiting"
                for each in self._steps
            }  # fmt: skip
            return self._number, {
                "type": "state",
                "sensor": self._sensor,
                "phase": self._phase,
                "step": step.name if step else None,
                "steps": [{**asdict(each), "status": status[each.name]} for each in self._steps],
                "checks": [
                    {
                        "step": check.step,
                        "name": check.name,
                        "value": number(check),
                        "passed": check.passed,
                        "fault": check.fault,
                        "advice": check.advice,
                    }
                    for check in checks
                ],
                "faults": list(result.faults) if result else [],
                "verdict": result.verdict if result else "",
                "simulated": self._simulated or bool(result and result.simulated),
                "error": self._error or self._silence,
                "toml": bool(result and result.toml()),
                "report": result is not None,
                "paths": self._paths,
            }

    def meter(self) -> dict[str, Any]:
        """Return the newest levels in dBFS, root mean square and peak, and the time recorded in s."""
        return {
            "type": "meter",
            "levels": [[finite(each, 1) for each in row] for row in self._levels],
            "clips": [peak >= LOUD_LEVEL for _, peak in self._levels],
            "seconds": round(self._seconds, 2),
        }

    def refresh(self, clients: Clients) -> bool:  # noqa: ARG002
        """Encode the state and the meter where they have changed."""
        before = self.state_text, self.meter_text
        if self._encoded != self._number:
            self._encoded, state = self.state()
            self.state_text = packed(state)
        self.meter_text = packed(self.meter())
        return before != (self.state_text, self.meter_text)

    def enter(self) -> Viewer:
        """Return a browser that shows the state."""
        return _Browser(self)

    def _page(self) -> Page:
        package = "monochord.bringup"
        html = static(package, "bring_up.html")["bring_up.html"]
        return Page(
            path="bring-up",
            title="Bring-up",
            html=html.replace(b"<!--sensor-->", drawing(load_sensor(self._sensor)).encode()),
            files=static(package, "bring_up.js"),
            feed=self,
            socket="bring-up-live",
            routes=(Route("/sensor.toml", self._toml), Route("/report.html", self._report)),
        )

    async def _toml(self, _: Request) -> Response:
        text = self._result.toml() if self._result else None
        if text is None:
            return PlainTextResponse("There is no sensor file: the pitch is not measured.\n", 404)
        headers = {"content-disposition": 'attachment; filename="mine.toml"'}
        return Response(text, media_type="application/toml", headers=headers)

    async def _report(self, _: Request) -> Response:
        result = self._result
        if result is None:
            return PlainTextResponse("There is no report: no step is recorded.\n", 404)
        html = await asyncio.to_thread(report, result)
        return Response(html, media_type="text/html", headers={"content-security-policy": REPORT_POLICY})


class _Browser(Viewer):
    """An open page of a bring-up."""

    def __init__(self, page: BringUpPage) -> None:
        self._page = page
        self._shown = self._metered = ""

    def news(self) -> Iterator[str]:
        """Yield the newest state and meter."""
        if (state := self._page.state_text) != self._shown:
            self._shown = state
            yield state
        if (meter := self._page.meter_text) != self._metered:
            self._metered = meter
            yield meter

    def ask(self, content: str | bytes) -> None:
        """Make a choice."""
        self._page.commands.carry_out(self._page.commands.read(content))

    def leave(self) -> None:
        """Leave the bring-up to other browsers."""


class _PageGuide(Guide):
    """Asks a page, and passes on what the source hears meanwhile."""

    def __init__(self, page: BringUpPage, source: ListenableSource) -> None:
        self._page, self._source = page, source

    def choose(self, step: Step | None, result: BringUp | None) -> str:
        """Ask the page."""
        if step is None:
            self._page.save()
        while True:
            with self._listening():
                choice = self._page.ask(step, result)
            if not (choice == END and step is not None):
                return choice
            self._page.save()
            step = None  # an early end: what is there is shown, and steps can still be repeated

    def show(self, result: BringUp) -> None:
        """Show the checks."""
        self._page.show(result)

    def failed(self, step: Step, error: MonochordError) -> None:  # noqa: ARG002
        """Show the error; the step is asked again."""
        self._page.say(error)

    @contextmanager
    def _listening(self) -> Generator[None]:
        ended = threading.Event()

        def listen() -> None:
            while not ended.is_set():
                try:
                    self._source.listen(ended)
                except MonochordError as error:
                    self._page.say_silent(str(error))
                ended.wait(RETRY)

        thread = threading.Thread(target=listen, name="meter", daemon=True)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()
