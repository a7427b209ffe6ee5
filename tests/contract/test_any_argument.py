"""Whatever a program passes to a public name is taken where its sense is clear, or refused in one line.

Each name of ``mc.__all__``, and each public method of the objects that it gives, is called with the values of
`FEW`, or as a slow test of `ABSURD`, for each of its arguments, all other arguments being usual ones.
``pytest -s`` prints the counts.
"""

import asyncio
import inspect
import math
import resource
import signal
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, is_dataclass
from datetime import UTC, datetime
from decimal import Decimal
from fractions import Fraction
from functools import cache, partial
from itertools import count, islice
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pytest

import monochord as mc
from monochord.core.types import StreamHealth
from monochord.front.available import registries
from monochord.perception.model import ModelState

CPU_LIMIT = 10.0
"""Longest time of a call, in s of this process: loading a library takes some of it."""
MEMORY = 6 << 30
"""Memory that all calls may add, in bytes."""
STRING = {"length": 0.65, "linear_density": 6.5e-4, "tension": 65.0, "tension_per_force": 6.0}


@cache
def nested(depth: int) -> list[Any]:
    value: list[Any] = []
    for _ in range(depth):
        value = [value]
    return value


@cache
def nested_table(depth: int) -> dict[str, Any]:
    value: dict[str, Any] = {}
    for _ in range(depth):
        value = {"a": value}
    return value


class Hostile:
    """An object whose every conversion fails."""

    def _fails(self, *_: object) -> Any:
        raise RuntimeError("no conversion")

    __float__ = __index__ = __len__ = __bool__ = __array__ = __fspath__ = _fails  # pyright: ignore[reportAssignmentType]

    def __repr__(self) -> str:
        raise RuntimeError("no text")


ABSURD: dict[str, Callable[[], Any]] = {
    "None": lambda: None,
    "True": lambda: True,
    "False": lambda: False,
    "0": lambda: 0,
    "-1": lambda: -1,
    "1": lambda: 1,
    "10**30": lambda: 10**30,
    "10**400": lambda: 10**400,
    "-10**400": lambda: -(10**400),
    "10**5000": lambda: 10**5000,
    "nan": lambda: math.nan,
    "inf": lambda: math.inf,
    "-inf": lambda: -math.inf,
    "-0.5": lambda: -0.5,
    "1e300": lambda: 1e300,
    "5e-324": lambda: 5e-324,
    "1j": lambda: 1j,
    "Decimal nan": lambda: Decimal("nan"),
    "Fraction": lambda: Fraction(1, 3),
    "huge Fraction": lambda: Fraction(10**400),
    "no text": lambda: "",
    "text": lambda: "nonsense",
    "text nan": lambda: "nan",
    "text 1e999": lambda: "1e999",
    "zero byte": lambda: "a\0b",
    "256 letters": lambda: "a" * 256,
    "long path": lambda: "ab/" * 5000,
    "1e5 letters": lambda: "a" * 100_000,
    "half a surrogate": lambda: "\ud800",
    "byte as text": lambda: "\udcff",
    "line end": lambda: "a\nb",
    "bytes": lambda: b"nonsense",
    "bytearray": lambda: bytearray(b"nonsense"),
    "no list": list,
    "list of None": lambda: [None],
    "list of numbers": lambda: [1, 2.5],
    "list of text": lambda: ["a"],
    "list of zero byte": lambda: ["a\0b"],
    "list of lists": lambda: [[1], [1, 2]],
    "deep list": lambda: nested(5_000),
    "tuple": lambda: (math.nan, math.nan),
    "range": lambda: range(10**12),
    "endless": count,
    "generator": lambda: (each for each in [None]),
    "no table": dict,
    "table": lambda: {"a": 1},
    "table of numbers": lambda: {1: 2},
    "deep table": lambda: nested_table(5_000),
    "set": lambda: {1, 2},
    "object": object,
    "hostile": Hostile,
    "class": lambda: int,
    "function": lambda: lambda *_: None,
    "datetime": lambda: datetime.now(UTC),
    "path": lambda: Path("nonsense"),
    "long name": lambda: Path("a" * 256),
    "device": lambda: Path("/dev/zero"),
    "folder": lambda: Path("/"),
    "np nan": lambda: np.float64(math.nan),
    "np half": lambda: np.float16(0.5),
    "np -1": lambda: np.int64(-1),
    "np bool": lambda: np.bool_(True),
    "np time": lambda: np.datetime64("2026-01-01T00:00:00", "ns"),
    "np 0-d nan": lambda: np.array(math.nan),
    "np text": lambda: np.array(["a"]),
    "np objects": lambda: np.array([None]),
    "np complex": lambda: np.zeros(3, complex),
    "np empty": lambda: np.zeros((2, 0)),
    "np ints": lambda: np.ones((2, 5000), np.int16),
    "np bools": lambda: np.ones((2, 5000), np.bool_),
    "np ones": lambda: np.ones(3),
    "np nans": lambda: np.full((2, 5000), math.nan),
    "np cube": lambda: np.ones((2, 2, 2)),
    "np record": lambda: np.zeros(2, [("a", "f8")]),
    "string": lambda: mc.StringParams(**STRING),
}


FEW = (
    *("None", "True", "-1", "10**400", "nan", "inf", "5e-324", "1j"),
    *("text", "zero byte", "1e5 letters", "half a surrogate", "bytes", "device"),
    *("list of None", "deep list", "endless", "hostile"),
    *("np text", "np empty", "np ints", "np cube", "string"),
)
"""A value or two of each kind; ``make test-all`` tries all of `ABSURD`."""


@dataclass(frozen=True, kw_only=True)
class Door:
    """A public callable with usual arguments; `call` makes what has a state, for each call anew."""

    call: Callable[[], Callable[..., Any]]
    usual: Mapping[str, Callable[[], Any]] = field(default_factory=dict[str, Any])
    more: tuple[str, ...] = ()
    """Options that `**options` takes."""
    nan: tuple[str, ...] = ()
    """Arguments in which NaN has a documented sense."""
    skip: tuple[str, ...] = ()
    documented: tuple[type[Exception], ...] = ()
    """Further errors that the docstring names."""

    def arguments(self) -> list[str]:
        parameters = inspect.signature(self.call()).parameters.values()
        named = [each.name for each in parameters if each.kind != each.VAR_KEYWORD]
        return [name for name in (*named, *self.more) if name not in self.skip]

    def calls(self, name: str, value: Any) -> Any:
        function = self.call()
        chosen = {key: make() for key, make in self.usual.items()} | {name: value}
        parameters = inspect.signature(function).parameters.values()
        by_place = [
            each.name for each in parameters if each.kind in (each.POSITIONAL_ONLY, each.VAR_POSITIONAL)
        ]
        args = [chosen.pop(each) for each in by_place if each in chosen]
        return used(function(*args, **chosen))


def used(result: Any) -> Any:
    """Return a result, or the first values of one that is taken step by step."""
    if inspect.isasyncgen(result):
        return asyncio.run(first(result))
    if isinstance(result, Iterator):
        return list(islice(result, 2))  # pyright: ignore[reportUnknownArgumentType]
    if hasattr(result, "__enter__") and inspect.isgenerator(getattr(result, "gen", None)):
        with result:
            return None
    return result


async def first(updates: Any) -> Any:
    try:
        return await anext(updates, None)
    finally:
        await updates.aclose()


@dataclass(frozen=True, kw_only=True)
class World:
    """Files and objects that calls need."""

    folder: Path
    session: Path
    dataset: Path
    wav: Path
    model: mc.Model

    def fresh(self) -> Path:
        """Return the path of a file that does not exist."""
        return self.folder / f"new-{next(_NUMBERS)}.mcap"


_NUMBERS = count()


def sound() -> np.ndarray[Any, Any]:
    return np.random.default_rng(0).normal(scale=0.1, size=(2, 5000)).astype(np.float32)


def string() -> mc.StringParams:
    return mc.StringParams(**STRING)


def touch() -> mc.Contact:
    return mc.Contact(position=0.2, force=1.0)


def stream_signal() -> mc.Signal:
    return mc.Signal(sample_rate=44100, channels=2)


def window() -> mc.Window:
    return mc.Window(samples=sound()[:, :4410], start=0, sample_rate=44100)


def place() -> mc.Estimate:
    return mc.Estimate(value=0.08, std=1e-4, unit="m")


def prediction() -> mc.Prediction:
    return mc.Prediction(start=0, time=0.0, estimates={"position": place()})


def feed() -> mc.Feed:
    return mc.Feed(stream="room", columns=("temperature",), units=("K",))


def description() -> mc.Description:
    return mc.Description(name="take", sample_rate=44100, feeds=(feed(),))


def readings() -> mc.Readings:
    none = np.full(2, -1)
    time, values, status = np.array([0.0, 0.5]), np.zeros((2, 1)), np.zeros(2, np.uint32)
    return mc.Readings(
        stream="room", time=time, values=values, sequence=none, device_time=none, status=status
    )


def table() -> mc.PredictionTable:
    return mc.PredictionTable.of([0, 441], 44100, [{"position": place()}, {"position": place()}])


FIELDS = ("start", "end", "press", "sensor")


def skin_string() -> mc.SkinString:
    return mc.SkinString(start=(0, 0, 0), end=(0.2, 0, 0), press=(0, 0, -1), sensor="prototype")


def skin() -> mc.Skin:
    return mc.Skin(link="fingertip", strings={"top": skin_string()})


def pressed() -> mc.VirtualSensor:
    twin = mc.VirtualSensor("prototype", seed=1)
    twin.press(0.08, 1.0)
    return twin


def usual(**values: Any) -> dict[str, Callable[[], Any]]:
    """Return makers of arguments: each value is one already, or is passed as it is."""
    return {name: value if callable(value) else lambda value=value: value for name, value in values.items()}


def writer(world: World) -> mc.SessionWriter:
    return mc.SessionWriter(world.fresh(), description())


def located(_: World) -> Any:
    return mc.locate(sound(), length=0.65, open=110.0, sample_rate=44100)


def simple(name: str, /, **more: Any) -> Callable[[World], Door]:
    return lambda _: Door(call=lambda: getattr(mc, name), usual=usual(**more))


def method(make: Callable[[World], Any], name: str, /, **more: Any) -> Callable[[World], Door]:
    return lambda world: Door(call=lambda: getattr(make(world), name), usual=usual(**more))


DOORS: dict[str, Callable[[World], Door]] = {
    "Augmentation": simple("Augmentation"),
    "Augmentation.call": lambda _: Door(
        call=lambda: mc.Augmentation().__call__,
        usual=usual(windows=lambda: sound()[None], rows=[0]),
        nan=("windows",),
    ),
    "Block": simple("Block", samples=sound, start=0),
    "Contact": simple("Contact", position=0.2, force=1.0),
    "Description": simple("Description", name="take", sample_rate=44100),
    "Description.feed": method(lambda _: description(), "feed", stream="room"),
    "Description.load": method(lambda _: mc.Description, "load", text=lambda: description().dump()),
    "DeviceError": lambda _: Door(call=lambda: lambda text: mc.DeviceError(text), nan=("text",)),  # noqa: PLW0108  (its own signature is (*args))
    "MonochordError": lambda _: Door(call=lambda: lambda text: mc.MonochordError(text), nan=("text",)),  # noqa: PLW0108
    "InputError": lambda _: Door(
        call=lambda: mc.InputError, usual=usual(given="a", expected="b"), nan=("given", "expected", "remedy")
    ),
    "MissingLibraryError": lambda _: Door(
        call=lambda: mc.MissingLibraryError,
        usual=usual(task="a", library="b", extra="train"),
        nan=("task", "library", "extra"),
    ),
    "Estimate": lambda _: Door(
        call=lambda: mc.Estimate, usual=usual(value=0.08, std=1e-4, unit="m"), nan=("value", "std")
    ),
    "Estimate.abstain": method(lambda _: mc.Estimate, "abstain", unit="m", reason="silence"),
    "Feed": simple("Feed", stream="room", columns=("temperature",), units=("K",)),
    "Model": lambda world: Door(
        call=lambda: mc.Model, usual=usual(definition=world.model.definition, weights=world.model.weights)
    ),
    "Model.tuned": method(lambda w: w.model, "tuned", string=lambda: mc.load_sensor("prototype").string),
    "Model.within": method(lambda w: w.model, "within", sensing_range=(0.06, 0.14)),
    "Model.check": method(lambda w: w.model, "check", signal=stream_signal, size=4410),
    "Model.correction": method(lambda w: w.model, "correction", name="position"),
    "Model.predict": method(lambda w: w.model, "predict", sound=sound),
    "Model.score": method(
        lambda w: w.model,
        "score",
        sound=sound,
        truth=lambda: {"contact": np.ones(5000), "position": np.full(5000, 0.08)},
    ),
    "Model.save": method(lambda w: w.model, "save", folder=lambda: "saved"),
    "Model.step": method(lambda w: w.model, "step", state=ModelState, window=window),
    "Model.stream": method(lambda w: w.model, "stream", signal=stream_signal, size=4410),
    "Prediction": simple("Prediction", start=0, time=0.0, estimates=lambda: {"position": place()}),
    "Prediction.estimate": method(lambda _: prediction(), "estimate", name="force"),
    "PredictionTable": simple(
        "PredictionTable",
        start=lambda: np.array([0, 441]),
        time=lambda: np.array([0.0, 0.01]),
        estimates=lambda: table().estimates,
    ),
    "PredictionTable.of": method(
        lambda _: mc.PredictionTable,
        "of",
        starts=[0],
        sample_rate=44100,
        rows=lambda: [{"position": place()}],
    ),
    "PredictionTable.getitem": lambda _: Door(
        call=lambda: table().__getitem__, usual=usual(key="position"), documented=(IndexError,)
    ),
    "Readings": lambda _: Door(
        call=lambda: mc.Readings,
        usual={name: lambda name=name: getattr(readings(), name) for name in mc.Readings.__annotations__},
    ),
    "Run": simple("Run", signal=stream_signal),
    "SessionReader": lambda w: Door(call=lambda: mc.SessionReader, usual=usual(path=w.session)),
    "SessionReader.messages": method(lambda w: mc.read_session(w.session), "messages", topic="/audio"),
    "SessionReader.decoded": method(lambda w: mc.read_session(w.session), "decoded", topic="/audio"),
    "SessionReader.to_numpy": method(lambda w: mc.read_session(w.session), "to_numpy", stream="room"),
    "SessionReader.to_pandas": method(lambda w: mc.read_session(w.session), "to_pandas", stream="room"),
    "SessionReader.readings": method(lambda w: mc.read_session(w.session), "readings", stream="room"),
    "SessionWriter": lambda w: Door(
        call=lambda: lambda **each: mc.SessionWriter(**each).close(),
        usual=usual(path=w.fresh, description=description),
        more=("path", "description", "clock"),
        skip=("each",),
    ),
    "SessionWriter.audio": method(writer, "audio", block=lambda: mc.Block(samples=sound(), start=0)),
    "SessionWriter.readings": method(writer, "readings", readings=readings),
    "SessionWriter.labels": method(
        writer, "labels", time=lambda: np.zeros(2), columns=lambda: {"contact": np.zeros(2)}
    ),
    "SessionWriter.event": method(writer, "event", time=0.0, kind="mark"),
    "SessionWriter.clocks": method(writer, "clocks", time=0.0, offsets=lambda: {"wall": 0.0}),
    "SessionWriter.flush": method(writer, "flush"),
    "Signal": simple("Signal", sample_rate=44100, channels=2),
    "Skin": simple("Skin", link="fingertip", strings=lambda: {"top": skin_string()}),
    "Skin.combine": method(lambda _: skin(), "combine", estimates=lambda: {"top": prediction()}),
    "Skin.listen": lambda _: Door(
        call=lambda: skin().listen,
        usual=usual(source=sound, model="closed_form", sample_rate=44100),
        more=("sample_rate",),
    ),
    "SkinString": lambda _: Door(
        call=lambda: mc.SkinString, usual={name: partial(getattr, skin_string(), name) for name in FIELDS}
    ),
    "StringParams": simple("StringParams", **STRING),
    "Task": simple("Task", label="force", loss="laplace"),
    "Update": simple(
        "Update", prediction=prediction, window=window, health=StreamHealth, truth=dict, skipped=0
    ),
    "Update.estimate": method(
        lambda _: mc.Update(
            prediction=prediction(), window=window(), health=StreamHealth(), truth={}, skipped=0
        ),
        "estimate",
        name="position",
    ),
    "VirtualSensor": lambda _: Door(
        call=lambda: lambda **each: mc.VirtualSensor(**each).advance(0.001),
        more=("sensor", "seed", "build", "day", "world", "sample_rate", "objects"),
        skip=("each",),
    ),
    "VirtualSensor.lead": method(
        lambda _: mc.VirtualSensor(objects=["plastic"]), "lead", step=0.01, position=0.08, force=(0.0, 1.0)
    ),
    "VirtualSensor.restore": method(
        lambda _: mc.VirtualSensor(), "restore", snapshot=lambda: mc.VirtualSensor().snapshot()
    ),
    "VirtualSensors": lambda _: Door(
        call=lambda: lambda **each: mc.VirtualSensors(**each).advance(0.001),
        usual=usual(count=2),
        more=("sensor", "count", "seed", "build", "day", "world", "sample_rate", "objects", "cores"),
        skip=("each",),
    ),
    "VirtualSensors.lead": method(
        lambda _: mc.VirtualSensors(count=2, objects=["plastic"]), "lead", step=0.01, position=0.08
    ),
    "VirtualSensors.advance": method(lambda _: mc.VirtualSensors(count=2), "advance", seconds=0.001),
    "VirtualSensors.restore": method(
        lambda _: mc.VirtualSensors(count=1), "restore", snapshots=lambda: [mc.VirtualSensor().snapshot()]
    ),
    "VirtualSensor.press": method(lambda _: mc.VirtualSensor(), "press", position=0.08, force=1.0),
    "VirtualSensor.change": method(lambda _: pressed(), "change", force=1.0),
    "VirtualSensor.slide": method(lambda _: pressed(), "slide", seconds=0.1),
    "VirtualSensor.release": method(lambda _: pressed(), "release"),
    "VirtualSensor.drive": method(lambda _: pressed(), "drive", first=True, second=True),
    "VirtualSensor.advance": method(lambda _: pressed(), "advance", seconds=0.001),
    "Window": lambda _: Door(
        call=lambda: lambda **each: mc.Window(**each).duration,
        usual=usual(samples=sound, start=0, sample_rate=44100),
        more=("samples", "start", "sample_rate", "has_gap"),
        skip=("each",),
    ),
    "audit": lambda w: Door(call=lambda: mc.audit, usual=usual(data=w.dataset)),
    "available": simple("available", kind="sources"),
    "build": lambda _: Door(call=lambda: mc.build, usual=usual(sessions=["missing.mcap"], out="made")),
    "calibrate": lambda _: Door(
        call=lambda: mc.calibrate, usual=usual(model="demo", sessions="missing.mcap")
    ),
    "collect": simple("collect", settings=["group=[]"]),
    "contact_bound": simple(
        "contact_bound", string=string, contact=touch, snr=100.0, duration=0.1, sample_rate=44100.0
    ),
    "design": lambda _: Door(
        call=lambda: mc.design,
        usual=usual(gauge=0.254e-3, tension=40.0, resolution=math.nan),
        more=(
            "length",
            "range",
            "resolution",
            "forces",
            "gauge",
            "tension",
            "wire",
            "frame",
            "mount",
            "window",
            "gap",
            "level",
            "nothing",
        ),
        skip=("wishes",),
    ),
    "detection_score": simple(
        "detection_score", reference=lambda: np.array([True, False]), probability=lambda: np.array([0.9, 0.2])
    ),
    "evaluate": simple("evaluate", sessions="missing.mcap"),
    "features": lambda _: Door(
        call=lambda: mc.features, usual=usual(audio=sound, feature="log_mel"), more=("bins",)
    ),
    "force_from_tension": simple("force_from_tension", string=string, tension=68.0),
    "identify": lambda _: Door(
        call=lambda: mc.identify,
        usual=usual(recordings=sound, sample_rate=44100, length=0.2),
        more=("sample_rate",),
    ),
    "listen": lambda _: Door(
        call=lambda: mc.listen,
        usual=usual(source=sound, model="closed_form", string="prototype", sample_rate=44100),
        more=("sample_rate",),
    ),
    "listen twin": lambda _: Door(
        call=lambda: mc.listen,
        usual=usual(source="twin", model="closed_form", speed=0.0, seconds=0.2),
        more=("seed", "speed"),
        skip=("source", "model"),
    ),
    "listen_async": lambda _: Door(
        call=lambda: mc.listen_async,
        usual=usual(source=sound, model="closed_form", string="prototype", sample_rate=44100),
        more=("sample_rate", "seconds", "hop"),
    ),
    "load": simple("load", path="demo"),
    "load_dataset": lambda w: Door(call=lambda: mc.load_dataset, usual=usual(path=w.dataset)),
    "LabelledData.arrays": method(lambda w: mc.load_dataset(w.dataset), "arrays"),
    "LabelledData.rows": method(lambda w: mc.load_dataset(w.dataset), "rows", part="train"),
    "LabelledData.labels": method(lambda w: mc.load_dataset(w.dataset), "labels", rows=lambda: np.array([0])),
    "FeatureRows.column": method(lambda _: mc.features(sound()), "column", name="mic 1 own 1 level"),
    "load_material": simple("load_material", name="wood"),
    "load_sensor": simple("load_sensor", name="prototype"),
    "load_skin": simple("load_skin", path="missing.toml"),
    "load_string": simple("load_string", name="appendix"),
    "locate": lambda _: Door(
        call=lambda: mc.locate,
        usual=usual(recording=sound, length=0.65, open=110.0, sample_rate=44100),
        more=("sample_rate", "allow_truncated"),
        skip=("each",),  # whose own errors are its own
    ),
    "Located.lines": method(located, "lines"),
    "Located.reasons": method(located, "reasons"),
    "locate_from_segments": simple("locate_from_segments", length=0.65, f1=695.0, f2=374.2),
    "mean_absolute_error": simple(
        "mean_absolute_error", reference=lambda: np.ones(3), estimate=lambda: np.zeros(3)
    ),
    "open_frequency": simple("open_frequency", string=string),
    "publish": simple("publish", what="missing", out="published", licence="apache-2.0"),
    "publish demo": simple("publish", what="demo", out="made/demo", licence="apache-2.0"),
    "read_session": lambda w: Door(call=lambda: mc.read_session, usual=usual(path=w.session)),
    "record": lambda w: Door(
        call=lambda: mc.record,
        usual=usual(path=w.fresh, source="twin", seconds=0.02, speed=0.0),
        more=("seed",),
    ),
    "regression_score": simple(
        "regression_score", reference=lambda: np.ones(3), estimate=lambda: np.zeros(3), limit=0.1
    ),
    "segment_frequencies": simple("segment_frequencies", string=string, contact=touch),
    "simulate": lambda _: Door(
        call=lambda: mc.simulate, usual=usual(seconds=0.01), more=("route", "sample_rate")
    ),
    "Sound.plot": method(lambda _: mc.simulate(seconds=0.01), "plot"),
    "split_dataset": lambda w: Door(
        call=lambda: mc.split_dataset,
        usual=usual(dataset=lambda: mc.load_dataset(w.dataset).dataset, by="time"),
    ),
    "stiff_partials": simple("stiff_partials", f0=100.0, inharmonicity=1e-4, number=1.0),
    "tension_from_segments": simple("tension_from_segments", string=string, f1=695.0, f2=374.2),
    "train": simple("train", data="missing"),
    "tune": lambda w: Door(call=lambda: mc.tune, usual=usual(sources=w.wav, sensor="prototype")),
    "windows": simple(
        "windows", blocks=lambda: [mc.Block(samples=sound(), start=0)], size=441, hop=441, sample_rate=44100
    ),
}
"""Each public name that takes arguments, and the methods of the objects that users get."""
NO_ARGUMENTS = (
    "Connection",
    "Estimator",
    "Extractor",
    "Feature",
    "Figure",
    "Head",
    "Instrument",
    "Sink",
    "Source",
    "Stream",
    "Writer",
)
"""Base classes of plug-ins: they have no arguments; their plug-ins are in `test_options_of_plug_ins`."""


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    import soundfile

    folder = tmp_path_factory.mktemp("world")
    twin = ["groups=[{name='hold', grid=[2, 1], hold=0.3}]"]
    data = mc.build(mc.collect("quick", folder / "sessions", settings=twin), folder / "dataset")
    path = folder / "take.mcap"
    with mc.SessionWriter(path, description()) as out:
        out.audio(mc.Block(samples=sound(), start=0))
    soundfile.write(folder / "noise.wav", sound().T, 44100)
    return World(
        folder=folder, session=path, dataset=data.path, wav=folder / "noise.wav", model=mc.load("demo")
    )


@contextmanager
def limited() -> Generator[None]:
    """Limit the CPU time of a call, so that one that hangs fails."""

    def late(*_: object) -> None:
        raise TimeoutError(f"more than {CPU_LIMIT:g} s")

    before = signal.signal(signal.SIGVTALRM, late)
    signal.setitimer(signal.ITIMER_VIRTUAL, CPU_LIMIT)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


@pytest.fixture
def little_memory() -> Iterator[None]:
    """Let a call that takes too much memory fail, instead of the machine."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


def outcome(
    call: Callable[[], object],
    argument: str,
    *,
    is_nan: bool,
    documented: tuple[type[Exception], ...] = (),
) -> str:
    """Return "taken", "refused", or what is wrong."""
    try:
        with limited():
            result = call()
    except documented:
        return "refused"
    except mc.MonochordError as error:
        return wrong_line(error) or "refused"
    except Exception as error:  # noqa: BLE001
        return f"{type(error).__name__}: {str(error)[:150]}"
    if is_nan or not_a_number(result):
        return f"NaN is taken: a {type(result).__name__}"
    return misfit(result, argument) or "taken"


def wrong_line(error: mc.MonochordError) -> str:
    """Return what is wrong with the line of an error."""
    line = str(error)
    if len(line.splitlines()) != 1 or len(line) > 4000:
        return f"more than a line: {line[:200]!r}"
    return "" if type(error) is not mc.InputError or "expected" in line else f"nothing expected: {line[:200]}"


def not_a_number(result: Any) -> bool:
    if isinstance(result, tuple):
        return any(map(not_a_number, result))  # pyright: ignore[reportUnknownArgumentType]
    return isinstance(result, float) and math.isnan(result)


def misfit(result: Any, argument: str) -> str:
    """Return what is wrong with a field that a dataclass took: numbers and text are of the annotated type."""
    if not (is_dataclass(result) and argument in {each.name for each in fields(result)}):
        return ""
    kind = get_type_hints(type(result)).get(argument)
    value = getattr(result, argument)
    fits = type(value) is kind if kind in (bool, int, float, str) else True
    return "" if fits else f"a {type(value).__name__} is kept as {argument}"


NANS = {"nan", "np nan", "np 0-d nan", "Decimal nan"}
COUNTS = dict.fromkeys(("calls", "taken", "refused", "raw"), 0)


def refused_or_taken(door: Door, name: str, values: Iterable[str]) -> list[str]:
    """Call a door with absurd values for each argument, count, and return what is neither."""
    raw: list[str] = []
    for argument in door.arguments():
        for label in values:
            found = outcome(
                partial(door.calls, argument, ABSURD[label]()),
                argument,
                is_nan=label in NANS and argument not in door.nan,
                documented=door.documented,
            )
            COUNTS["calls"] += 1
            COUNTS[found if found in COUNTS else "raw"] += 1
            if found not in COUNTS:
                raw.append(f"{name}({argument}={label}): {found}")
    return raw


SLOW = {"build", "calibrate", "collect", "evaluate", "record", "split_dataset", "train", "Located.lines"}
"""Names whose usual call takes a while."""


SOME_OR_ALL = pytest.mark.parametrize(
    "values", [FEW, pytest.param(tuple(ABSURD), marks=pytest.mark.slow)], ids=["few", "all"]
)


@SOME_OR_ALL
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in DOORS]
)
def test_any_value_is_taken_or_refused_in_one_line(
    name: str,
    values: tuple[str, ...],
    world: World,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    little_memory: None,
) -> None:
    monkeypatch.chdir(tmp_path)
    raw = refused_or_taken(DOORS[name](world), name, values)
    assert not raw, "\n".join(raw)


@SOME_OR_ALL
@pytest.mark.parametrize("folder", registries())
def test_options_of_plug_ins(folder: str, values: tuple[str, ...], little_memory: None) -> None:
    registry, raw = registries()[folder], list[str]()
    for name in registry.names():
        kind = registry.load(name)
        required = [
            each for each in inspect.signature(kind).parameters.values() if each.default is each.empty
        ]
        usual = {each.name: lambda: "run" for each in required}
        raw += refused_or_taken(Door(call=lambda kind=kind: kind, usual=usual), f"{folder}.{name}", values)
    assert not raw, "\n".join(raw)


def test_every_public_name_is_called() -> None:
    names = {name.partition(".")[0].partition(" ")[0] for name in DOORS}
    assert set(mc.__all__) - {"__version__"} <= names | set(NO_ARGUMENTS)
    for name in NO_ARGUMENTS:
        assert not inspect.signature(getattr(mc, name)).parameters
    sys.stdout.write(
        "\n{calls} calls: {taken} taken, {refused} refused in one line, {raw} raw\n".format(**COUNTS)
    )


SENSOR = "design = 'prototype'\n[tuning]\nopen_frequency = 1000.0\n"


def test_numbers_of_numpy_are_numbers() -> None:
    plain = mc.simulate("appendix", position=0.2275, force=0.5, seconds=0.05)
    kinds: list[Any] = [np.float64, np.array, lambda value: np.array(value, object), Fraction]
    for kind in kinds:
        other = mc.simulate("appendix", position=kind(0.2275), force=kind(0.5), seconds=kind(0.05))
        assert np.array_equal(other.microphones, plain.microphones)
    whole: Any = np.int64
    rows = mc.features(sound(), feature="log_mel", bins=64, sample_rate=44100)
    assert np.array_equal(
        mc.features(sound(), feature="log_mel", bins=np.int64(64), sample_rate=whole(44100)), rows
    )
    one, other = (mc.VirtualSensor(seed=seed, build=seed, day=seed) for seed in (1, whole(1)))
    assert one.sensor == other.sensor
    assert np.array_equal(one.advance(0.1)[0], other.advance(kinds[0](0.1))[0])
    assert mc.Contact(position=np.float64(0.5), force=1) == mc.Contact(position=0.5, force=1.0)
    assert type(mc.Contact(position=np.float64(0.5), force=1).position) is float
    updates = mc.listen("twin", "closed_form", seed=np.int64(1), seconds=np.float64(0.2), speed=0.0)
    assert len(list(updates)) == 11


def test_a_path_names_a_sensor(tmp_path: Path) -> None:
    file = tmp_path / "sensor.toml"
    file.write_text(SENSOR, encoding="utf-8")
    assert mc.VirtualSensor(file).design == mc.load_sensor(file) == mc.load_sensor(str(file))
    assert mc.features(sound(), file).shape == mc.features(sound(), str(file)).shape
    assert len(mc.load("demo").predict(sound(), sensor=file)) == 2
    assert len(list(mc.listen(sound(), "closed_form", sensor=file, sample_rate=44100))) == 2
    assert mc.load_material(Path("wood")) == mc.load_material("wood")


def test_what_load_returns_answers_as_its_name_does() -> None:
    take = np.random.default_rng(0).normal(scale=0.1, size=(2, 8820)).astype(np.float32)
    named, loaded = (
        list(mc.listen(take, model=model, sample_rate=44100, sensor="prototype"))
        for model in ("demo", mc.load("demo"))
    )
    assert [str(each) for each in named] == [str(each) for each in loaded]


@pytest.mark.parametrize("kind", [np.int8, np.int16, np.int32, np.uint8, np.uint16, np.int64, np.bool_])
def test_integer_sound_is_refused_everywhere(kind: type[np.integer[Any]]) -> None:
    samples: Any = np.ones((2, 5000), kind)
    calls: tuple[Callable[[], object], ...] = (
        lambda: mc.features(samples),
        lambda: mc.load("demo").predict(samples),
        lambda: next(mc.listen(samples, sample_rate=44100)),
        lambda: mc.identify(samples, length=0.2, sample_rate=44100),
        lambda: mc.Window(samples=samples, start=0, sample_rate=44100),
        lambda: mc.Block(samples=samples, start=0),
        lambda: mc.Augmentation()(samples[None], [0]),
    )
    for call in calls:
        with pytest.raises(mc.InputError, match=r"float in full scale, -1 to 1; divide 16-bit"):
            call()


def test_a_byte_order_mark_is_no_part_of_a_file(tmp_path: Path) -> None:
    mark = "\ufeff"
    sensor, plan, model = tmp_path / "sensor.toml", tmp_path / "plan.toml", tmp_path / "model"
    sensor.write_text(mark + SENSOR.replace("\n", "\r\n"), encoding="utf-8")
    assert mc.load_sensor(sensor).string == mc.load_sensor(_written(tmp_path / "plain.toml", SENSOR)).string
    groups = "[[groups]]\nname = 'hold'\ngrid = [2, 1]\nhold = 0.3\n"
    title = "title = 'a plan'\nsource = 'a test'\n"
    plan.write_text(mark + title + groups, encoding="utf-8")
    sessions = mc.collect(plan, tmp_path / "sessions")
    data = mc.build(sessions, tmp_path / "dataset")
    for file in ("split.json", "manifest.json"):
        _written(data.path / file, mark + (data.path / file).read_text(encoding="utf-8"))
    assert len(mc.load_dataset(data.path)) == len(data)
    mc.load("demo").save(model)
    _written(model / "model.json", mark + (model / "model.json").read_text(encoding="utf-8"))
    assert mc.load(model).definition == mc.load("demo").definition


def _written(file: Path, text: str) -> Path:
    file.write_text(text, encoding="utf-8")
    return file


@pytest.mark.parametrize(
    "nesting", ["a." * 3000 + "a = 1", "a = " + "[" * 3000 + "]" * 3000, "a = " + "{a=" * 99 + "1" + "}" * 99]
)
def test_a_file_that_is_nested_deep_is_refused(nesting: str, tmp_path: Path) -> None:
    file = _written(tmp_path / "deep.toml", nesting)
    with pytest.raises(mc.InputError, match="expected"):
        mc.load_sensor(file)
    with pytest.raises(mc.InputError, match="expected"):
        mc.collect(
            "quick", tmp_path / "out", settings=[nesting.replace("a = ", "groups=").replace(".a =", ".a=")]
        )
