"""A summary of a model in a few lines."""

from monochord.perception.model.definition import Definition, HeadRecord
from monochord.physics.sensors import designs_with


def facts(definition: Definition) -> tuple[str, list[tuple[str, str]]]:
    """Return a title and (name, text) pairs: a model's sensor, training, input, feature and heads.

    >>> from monochord.perception.model import load
    >>> title, rows = facts(load("demo").definition)
    >>> title, dict(rows)["feature"]
    ('Model: Heads across builds, on the measures of the reader', 'reading, 244 columns')
    """
    return f"Model: {definition.title or 'untitled'}", [
        ("sensor", _sensor(definition)),
        ("training", f"{_sessions(len(definition.sessions))}{', simulated' if definition.simulated else ''}"),
        ("input", _input(definition)),
        ("feature", f"{definition.feature.name}, {len(definition.feature.columns)} columns"),
        *((name, _head(record)) for name, record in definition.heads.items()),
    ]


def brief(definition: Definition) -> tuple[str, list[tuple[str, str]]]:
    """Return a title and (name, text) pairs for a prompt: a model's sensor, training and estimates."""
    title, rows = facts(definition)
    units = {name: record.task.unit for name, record in definition.heads.items()}
    estimates = ", ".join(f"{name} ({unit})" if unit else name for name, unit in units.items())
    return title, [("estimates", estimates), *rows[:3]]


def _sensor(definition: Definition) -> str:
    string = definition.string
    if string is None:
        return "not known"
    names = " or ".join(designs_with(string)) or "not among the presets"
    text = f"{names}, string of {1e3 * string.length:g} mm"
    places = definition.sensing_range
    text = f"{text}, senses {1e3 * places[0]:g} to {1e3 * places[1]:g} mm" if places else text
    return f"{text}; calibrated on {definition.calibrated_on}" if definition.calibrated_on else text


def _sessions(count: int) -> str:
    return f"{count} session{'s' * (count != 1)}"


def _input(definition: Definition) -> str:
    length = definition.window / definition.sample_rate
    return f"{definition.channels} channels at {definition.sample_rate} Hz, windows of {length:g} s"


def _head(record: HeadRecord) -> str:
    """Return what a head estimates, and how well its stated error holds where that was measured."""
    measured, unit = record.calibration.measured, record.task.unit
    if record.task.is_probability:
        text, error = "probability", measured.get("calibration_error")
        stated = f"calibration error {100.0 * error:.1g} %" if error is not None else ""
    else:
        text, share = f"quantity in {unit}" if unit else "quantity", measured.get("coverage_1")
        stated = f"standard error covers {100.0 * share:.0f} % of errors" if share is not None else ""
    where = f"{stated}, measured on {_sessions(record.calibration.sessions)}"
    text = f"{text} by {record.method.replace('_', ' ')}"
    touches = record.correction.touches if record.correction else 0
    calibrated = f"; calibrated by {touches} touches" if touches else ""
    return f"{text}; {where if stated else 'stated error not measured'}{calibrated}"
