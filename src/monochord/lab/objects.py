"""Random objects: materials and shapes between and beyond the presets, for varied touches."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from monochord.physics.materials import Material

SOFTEST, HARDEST = 3e8, 2.1e11
"""Range of Young's modulus in Pa: from soft plastic to steel."""
GELS = 5e5
"""Smallest Young's modulus of a random soft object, in Pa: a gel, softer than a fingertip."""
SHARPEST, BLUNTEST = 1e-3, 2e-2
"""Range of the radius at the contact, in m."""


def drawn_object(random: np.random.Generator) -> Material:
    """Return an object of random material and shape; all ranges are assumed.

    Stiffness, radius, roughness and its length are log-uniform. Friction and Stribeck speed lie within
    handbook values of dry and oiled solids on steel. The restitution e at 1 m/s, which gives Hunt and
    Crossley's loss 3 (1 - e) / 2, increases with hardness.

    >>> thing = drawn_object(np.random.default_rng(1))
    >>> thing == drawn_object(np.random.default_rng(1)), thing.name
    (True, 'drawn')
    """
    between = evenly(random)
    young_modulus = between(SOFTEST, HARDEST)
    hardness = np.log(young_modulus / SOFTEST) / np.log(HARDEST / SOFTEST)
    restitution = random.uniform(0.6, 0.8) + 0.15 * hardness
    kinetic = random.uniform(0.1, 0.5)
    return Material(
        name="drawn",
        title="An object drawn at random",
        source="Assumed: drawn from stated ranges, see monochord.lab.objects",
        young_modulus=young_modulus,
        poisson_ratio=float(random.uniform(0.2, 0.4)),
        loss=float(1.5 * (1.0 - restitution)),
        friction_static=float(kinetic * random.uniform(1.05, 1.5)),
        friction_kinetic=float(kinetic),
        stribeck_speed=between(0.003, 0.02),
        roughness=between(3e-7, 8e-6),
        roughness_length=between(1.5e-5, 3e-4),
        radius=between(SHARPEST, BLUNTEST),
    )


def smooth_object(random: np.random.Generator) -> Material:
    """Return a random hard and smooth object, of metal, glass or stone; all ranges are assumed.

    Ground and polished surfaces rub with little sound, and their friction goes from oiled to dry.

    >>> thing = smooth_object(np.random.default_rng(1))
    >>> thing.roughness < 2e-6, thing.name
    (True, 'drawn_smooth')
    """
    between = evenly(random)
    thing = drawn_object(random)
    kinetic = random.uniform(0.08, 0.6)
    return replace(
        thing,
        name="drawn_smooth",
        title="A hard and smooth object drawn at random",
        young_modulus=between(3e10, HARDEST),
        loss=float(1.5 * (1.0 - random.uniform(0.85, 0.95))),
        friction_static=float(kinetic * random.uniform(1.05, 1.5)),
        friction_kinetic=float(kinetic),
        roughness=between(2e-7, 1.5e-6),
        roughness_length=between(1e-5, 6e-5),
    )


def soft_object(random: np.random.Generator) -> Material:
    """Return a random soft object, from gel to soft plastic; all ranges are assumed.

    It damps the string, the more the softer it is, until little sound is left. Rubber-like friction, blunt
    shapes and rough skins are drawn too.

    >>> thing = soft_object(np.random.default_rng(1))
    >>> thing.young_modulus < SOFTEST, thing.name
    (True, 'drawn_soft')
    """
    between = evenly(random)
    young_modulus = between(GELS, SOFTEST)
    hardness = np.log(young_modulus / GELS) / np.log(SOFTEST / GELS)
    kinetic = random.uniform(0.3, 1.0)
    return Material(
        name="drawn_soft",
        title="A soft object drawn at random",
        source="Assumed: drawn from stated ranges, see monochord.lab.objects",
        young_modulus=young_modulus,
        poisson_ratio=float(random.uniform(0.05, 0.49)),
        loss=float(1.5 * (1.0 - random.uniform(0.3, 0.55) - 0.15 * hardness)),
        friction_static=float(kinetic * random.uniform(1.05, 1.5)),
        friction_kinetic=float(kinetic),
        stribeck_speed=between(0.003, 0.03),
        roughness=between(5e-7, 2e-5),
        roughness_length=between(2e-5, 5e-4),
        radius=between(1.5e-3, 1.5e-2),
    )


def evenly(random: np.random.Generator) -> Callable[[float, float], float]:
    """Return a log-uniform sampler."""
    return lambda low, high: float(np.exp(random.uniform(np.log(low), np.log(high))))


DRAWN: Mapping[str, Callable[[np.random.Generator], Material]] = {
    "drawn": drawn_object,
    "drawn_smooth": smooth_object,
    "drawn_soft": soft_object,
}
"""The sampler of an object for each session, by the material name in a plan."""
