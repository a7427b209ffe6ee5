"""What the paper reports of the real sensor, to stand beside other figures: a reference, not a rival.

Yi, Xing, Manchester and Fazeli, Sound of Touch, tables of contact location and of force under acoustic noise:
one real sensor, features of an Audio Spectrogram Transformer, windows of 0.1 s; noise is pop music from a
speaker 20 cm away. Slip and contact are reported there as told without error. Figures of a simulation and of
a real sensor measure different things: simulated ones have no wear, no glue and no room.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from monochord.evaluation.results import CLEAN

NOISE = "noise"


@dataclass(frozen=True, slots=True, kw_only=True)
class Reported:
    """Mean absolute error in SI units, share within 5 mm or 0.2 N, and Pearson's r."""

    mae: float
    within: float
    r: float


def _told(*columns: tuple[float, float, float]) -> dict[str, Reported]:
    return {
        condition: Reported(mae=mae, within=within, r=r)
        for condition, (mae, within, r) in zip((CLEAN, NOISE), columns, strict=True)
    }


PAPER: Mapping[str, Mapping[str, Mapping[str, Reported]]] = MappingProxyType(
    {
        "position": {
            "plastic": _told((2.7e-3, 0.878, 0.994), (3.1e-3, 0.833, 0.994)),
            "wood": _told((8.8e-3, 0.514, 0.863), (8.6e-3, 0.557, 0.857)),
            "metal_tube": _told((5.4e-3, 0.700, 0.952), (8.0e-3, 0.571, 0.893)),
            "allen_key": _told((2.7e-3, 0.829, 0.993), (2.8e-3, 0.871, 0.992)),
        },
        "force": {
            "plastic": _told((0.141, 0.744, 0.909), (0.131, 0.756, 0.928)),
            "wood": _told((0.111, 0.843, 0.903), (0.115, 0.829, 0.927)),
            "metal_tube": _told((0.172, 0.700, 0.908), (0.173, 0.657, 0.906)),
            "allen_key": _told((0.167, 0.671, 0.844), (0.165, 0.657, 0.819)),
        },
    }
)
"""Figures by quantity, object and condition (clean, noise)."""


def reported(quantity: str, body: str, condition: str) -> Reported | None:
    """Return what the paper has of a quantity, object and condition; None where it has nothing.

    Any music stands beside the paper's noise, which was music; no other noise does.

    Examples
    --------
    >>> told = reported("position", "wood", "music 10 dB")
    >>> told.mae if told else None
    0.0086
    >>> reported("position", "wood", "hum 10 dB")
    """
    kind = condition if condition == CLEAN else NOISE if condition.partition(" ")[0] == "music" else ""
    return PAPER.get(quantity, {}).get(body, {}).get(kind)
