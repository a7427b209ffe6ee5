"""What the page of a design asks for: one request, one answer, as JSON."""

from collections.abc import Mapping
from typing import Any, Literal, get_args, get_type_hints

import msgspec

from monochord.core.config import from_tree
from monochord.core.errors import InputError, MonochordError, did_you_mean
from monochord.front.design import StringDesign, design, design_string
from monochord.physics.design import FRAMES, MAX_MODE, NO_MODEL, WIRES, Wishes, base_sensor
from monochord.physics.lengthening import MountName
from monochord.physics.materials import material_names

MODELS = (Wishes().model, NO_MODEL)
"""Models that a page may name."""


class Request(msgspec.Struct, forbid_unknown_fields=True):
    """What a page asks for: what can be wished, one string, or the recommendation, by its wishes."""

    do: Literal["about", "string", "recommend"]
    wishes: dict[str, Any] = {}


def answer(request: bytes) -> dict[str, Any]:
    """Return the answer to a request as plain values; ``error`` is one line for one that is refused.

    >>> answer(b'{"do": "string", "wishes": {"gauge": 0.254e-3, "tension": 40, "length": 0}}')
    {'error': "option 'length' = 0: expected a number from 0.08 to 2 m"}
    """
    try:
        asked = msgspec.json.decode(request, type=Request)
        if asked.do == "about":
            return about()
        wishes = _wishes(asked.wishes)
        return one_string(wishes) if asked.do == "string" else recommendation(wishes)
    except MonochordError as error:
        return {"error": " ".join(str(error).split())}
    except (msgspec.DecodeError, RecursionError, UnicodeError) as error:
        return {"error": f"request: expected a JSON object with do and wishes ({error})"}
    except Exception as error:  # noqa: BLE001  (the page says it, whatever it is, and the next request is answered)
        return {"error": f"{type(error).__name__}: {error}"}


def about() -> dict[str, Any]:
    """Return what can be wished: limits and defaults, choices of names, and the prototype's string."""
    hints, usual = get_type_hints(Wishes, include_extras=True), Wishes()
    numbers = {name: meta for name, kind in hints.items() if (meta := _meta(kind)) is not None}
    base = base_sensor().string
    return {
        "limits": {name: [meta.ge, meta.le] for name, meta in numbers.items()} | {"forces": [1e-4, 10.0]},
        "wishes": {name: getattr(usual, name) for name in hints if name not in {"gauge", "tension"}},
        "string": {"gauge": base.core_diameter, "tension": base.tension, "length": base.length},
        "choices": {
            "wire": list(WIRES),
            "frame": list(FRAMES),
            "mount": list(get_args(MountName)),
            "model": list(MODELS),
            "material": list(material_names()),
        },
    }


def one_string(wishes: Wishes) -> dict[str, Any]:
    """Return what one string does, for the gauge, tension and length of the wishes."""
    made = design_string(wishes)
    tree, ambiguous = made.tree(), made.ambiguity
    return {
        **_summary(made),
        "curves": tree["curves"],
        "frames": tree["frames"],
        "mounts": tree["mounts"],
        "ambiguity": {
            "positions": ambiguous.positions,
            "share": ambiguous.share,
            "shares": ambiguous.pairs / MAX_MODE**2,
            "fundamental": ambiguous.fundamental.mean(),
        },
    }


def recommendation(wishes: Wishes) -> dict[str, Any]:
    """Return the recommended string of a sweep, its reasons, and what all others do."""
    made = design(**{name: getattr(wishes, name) for name in Wishes.__dataclass_fields__} | FREE)
    return {
        **_summary(made),
        "reasons": made.reasons(),
        "sweep": [[each.settling, each.force_std, not each.lacks] for each in made.candidates],
        "pareto": [[each.settling, each.force_std] for each in made.pareto],
    }


FREE = {"gauge": None, "tension": None}
"""What a recommendation sweeps."""


def encoded_answer(request: bytes) -> bytes:
    """Return the answer to a request as JSON."""
    return msgspec.json.encode(answer(request), enc_hook=_plain)


def _wishes(given: Mapping[str, Any]) -> Wishes:
    """Return the wishes; own materials and models are refused: a page names no files of this machine."""
    for kind, known in (("material", material_names()), ("model", MODELS)):
        name = given.get(kind, getattr(Wishes(), kind))
        if name not in known:
            raise InputError(f"{kind} '{name}'", "a name of the list", did_you_mean(str(name), known))
    return from_tree(Wishes, given)


def _summary(made: StringDesign) -> dict[str, Any]:
    one, string = made.chosen, made.chosen.string
    names = (
        "range", "frequency", "lowest", "highest", "position_std", "force_std", "force_std_most",
        "cents_per_newton", "drift", "drift_force", "settling", "bandwidth", "stress", "stress_share",
        "swing", "sag", "clearance", "fits_model", "lacks",
    )  # fmt: skip
    return {
        "title": made.sensor.title,
        "string": {"gauge": string.core_diameter, "tension": string.tension, "length": string.length},
        "usual": made.wishes.usual,
        "squeal": made.squeal,
        "toml": made.toml(),
        **{name: getattr(one, name) for name in names},
    }


def _meta(kind: Any) -> msgspec.Meta | None:
    """Return the range of a number, or of a number that may be None."""
    parts = (kind, *get_args(kind))
    metas = [each for part in parts for each in getattr(part, "__metadata__", ())]
    return next((each for each in metas if isinstance(each, msgspec.Meta)), None)


def _plain(value: Any) -> Any:
    """Return an array or a number of NumPy as plain values."""
    return value.tolist()
