"""Sweeps of simulated touches, and what the microphones hear of them."""

from dataclasses import dataclass, fields

import numpy as np

from monochord.core.types import Contact, Floats, StringParams
from monochord.physics.simulators import SIMULATORS, Case, Simulator
from monochord.physics.theory import TensionLaw, split_frequencies

SETTLE, LISTEN = 0.3, 0.2  # s: what is let pass of each touch, and the window that is looked at
USUAL_ROUTE = "modal"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """Touches along an axis: positions in m and forces in N, both (n,), of which one varies."""

    positions: Floats
    forces: Floats
    law: TensionLaw = "linear"

    def fundamentals(self, string: StringParams) -> tuple[Floats, Floats]:
        """Return f1 and f2 of theory in Hz for each touch, (n,) each."""
        return split_frequencies(string, self.positions, self.forces, self.law)


def simulator(name: str, route: str = USUAL_ROUTE) -> Simulator:
    """Return the model of this name; the route goes to models that have one, or that are told another."""
    has_routes = any(field.name == "route" for field in fields(SIMULATORS.load(name)))  # pyright: ignore[reportArgumentType]
    return SIMULATORS.build(name, {"route": route} if has_routes or route != USUAL_ROUTE else {})


def simulated_spectra(model: Simulator, string: StringParams, sweep: Sweep) -> tuple[Floats, Floats]:
    """Return the spectra of the simulated microphones for each touch of a sweep, after the transient.

    Parameters
    ----------
    model
        What simulates.
    string
        The string.
    sweep
        Touches; each is simulated by itself.

    Returns
    -------
    frequencies (bins,)
        In Hz.
    levels (touches, bins)
        Power of both microphones in dB, zero at the strongest line of each touch.
    """
    spectra = [_spectrum(model, case) for case in _cases(string, sweep)]
    power = np.array([heard for _, heard in spectra])
    levels = 10.0 * np.log10(power / power.max(axis=1, keepdims=True) + 1e-20)
    return spectra[0][0], levels


def _cases(string: StringParams, sweep: Sweep) -> list[Case]:
    assignments = (f"tension_law={sweep.law}",)
    touches = [
        Contact(position=float(x), force=float(force))
        for x, force in zip(sweep.positions, sweep.forces, strict=True)
    ]
    return [
        Case(string=string, contact=touch, seconds=SETTLE + LISTEN, assignments=assignments)
        for touch in touches
    ]


def _spectrum(model: Simulator, case: Case) -> tuple[Floats, Floats]:
    heard = model.run(case)
    late = heard.microphones[:, round(SETTLE * heard.sample_rate) :]
    size = 4 * late.shape[1]
    power = np.abs(np.fft.rfft(late * np.hanning(late.shape[1]), size)) ** 2
    return np.arange(power.shape[1]) * (heard.sample_rate / size), np.sum(power, axis=0)
