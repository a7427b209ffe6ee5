"""What ``monochord list`` shows: each plug-in with its options, each preset with its source, and settings."""

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeAlias

from monochord.capture import recording
from monochord.capture.devices import devices
from monochord.core.config import settings_of, to_tree
from monochord.core.errors import MonochordError
from monochord.core.registry import Registry
from monochord.front.available import registries
from monochord.lab.plan import Plan
from monochord.lab.plans import load_plan, plan_names
from monochord.live import LiveRun
from monochord.live.settings import DEFAULTS
from monochord.perception.model import load
from monochord.perception.model.bundled import bundled_names
from monochord.perception.training.settings import TrainingSettings
from monochord.physics.materials import load_material, material_names
from monochord.physics.sensors import load_sensor, sensor_names
from monochord.physics.simulators import SIMULATORS
from monochord.physics.strings import load_string, string_names

Entry: TypeAlias = dict[str, Any]
"""What is shown of a name: ``name``, ``summary`` and facts, as values that JSON can hold."""
SETTINGS: Mapping[str, tuple[str, type]] = {
    "live": ("A run of 'monochord live', also its --config.", LiveRun),
    "record": ("A run of 'monochord record', also its --config.", recording.RecordingSettings),
    "collect": ("A plan of 'monochord collect'.", Plan),
    "train": ("A run of 'monochord train', also its CONFIG.", TrainingSettings),
}
"""Purpose of each set of settings, and the dataclass that defines it."""
ON_REQUEST = ("devices", "settings")
"""Kinds that are listed only by name: one queries hardware, the other is long."""


def shelves() -> dict[str, Callable[[], Iterable[Entry]]]:
    """Return everything that can be listed: the function that yields the entries of each kind, by its name.

    >>> [entry["name"] for entry in shelves()["heads"]()]
    ['contact', 'force', 'position', 'slip']
    """
    kinds: dict[str, Callable[[], Iterable[Entry]]] = {
        name: lambda registry=registry: _plugins(registry) for name, registry in registries().items()
    }
    kinds |= {"strings": _strings, "sensors": _sensors, "materials": _materials, "plans": _plans}
    kinds |= {"models": _models, "devices": _devices, "settings": _settings}
    return dict(sorted(kinds.items()))


def _each(names: Iterable[str], entry: Callable[[str], Entry]) -> Iterable[Entry]:
    """Yield the entry of each name; one that cannot be loaded shows its error and hides no other."""
    for name in names:
        try:
            yield {"name": name, **entry(name)}
        except Exception as error:  # noqa: BLE001  (whatever a package of another author raises)
            reason = str(error) if isinstance(error, MonochordError) else f"{type(error).__name__}: {error}"
            yield {"name": name, "summary": f"broken: {' '.join(reason.split())}", "broken": reason}


def _plugins(registry: Registry[Any]) -> Iterable[Entry]:
    def entry(name: str) -> Entry:
        kind = registry.load(name)
        summary = (kind.__doc__ or "").strip().partition("\n")[0]
        return {"summary": summary, "options": _options(kind)}

    return _each(registry.names(), entry)


def _options(kind: type) -> Sequence[Entry]:
    """Return the settings of a dataclass as values for JSON."""
    return [
        {
            "name": each.name,
            "required": each.required,
            "default": _plain(each.default),
            "allowed": each.allowed,
        }
        for each in settings_of(kind)
    ]


def _plain(value: Any) -> Any:
    """Return a configuration value for JSON, which has no infinity."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(each) for each in value]
    return value


def _settings() -> Iterable[Entry]:
    for name, (summary, kind) in SETTINGS.items():
        options = _options(kind)
        for option in options if kind is LiveRun else ():
            if option["name"] in DEFAULTS:
                option |= {"required": False, "default": DEFAULTS[option["name"]], "allowed": "a table"}
        yield {"name": name, "summary": summary, "options": options}

    def entry(name: str) -> Entry:
        summary = f"The setup of 'monochord simulate' with --model {name}."
        options = _options(SIMULATORS.load(name).setup())
        return {"name": f"simulate_{name}", "summary": summary, "options": options}

    yield from _each(SIMULATORS.names(), entry)


def _devices() -> Iterable[Entry]:
    for device in devices():
        yield {**dataclasses.asdict(device), "summary": f"{device.source}: {device.summary}"}


def _models() -> Iterable[Entry]:
    def entry(name: str) -> Entry:
        definition = load(name).definition
        simulated = "simulated sound" if definition.simulated else "recorded sound"
        summary = f"Estimates {', '.join(definition.heads)}; trained on {simulated}."
        return {"summary": summary, "feature": definition.feature.name}

    return _each(bundled_names(), entry)


def _strings() -> Iterable[Entry]:
    def entry(name: str) -> Entry:
        preset = load_string(name)
        facts = {"source": preset.source, "notes": preset.notes, "open_frequency": preset.open_frequency}
        return {"summary": preset.title, **facts, "string": to_tree(preset.string)}

    return _each(string_names(), entry)


def _sensors() -> Iterable[Entry]:
    return _each(sensor_names(), lambda name: _preset(to_tree(load_sensor(name)), "sensor"))


def _materials() -> Iterable[Entry]:
    return _each(material_names(), lambda name: _preset(to_tree(load_material(name)), "material"))


def _plans() -> Iterable[Entry]:
    return _each(plan_names(), lambda name: _preset(to_tree(load_plan(name)), "plan"))


def _preset(tree: Entry, kind: str) -> Entry:
    """Return a preset as an entry: title, source and notes beside its values, under its kind."""
    facts = {"summary": tree.pop("title"), "source": tree.pop("source"), "notes": tree.pop("notes")}
    return {**facts, kind: {key: value for key, value in tree.items() if key != "name"}}
