"""Closed forms of the touched string: frequencies and their inverse, stiffness, sensitivities, bounds.

Touches are clamps unless stated otherwise: they cut the string into two segments that share only the tension.
Softer touches (a spring, a Hertzian contact) and the string's losses are included. Functions take plain
numbers or, where their signature says so, arrays.
"""

from monochord.physics.theory.bounds import (
    contact_bound,
    far_segment_bound,
    far_segment_sensitivity,
    frequency_sensitivities,
    series_bound,
    tone_bound,
)
from monochord.physics.theory.contact import (
    contact_width,
    edge_distance,
    hertz_stiffness,
    line_stiffness,
    loaded_frequencies,
    mindlin_ratio,
    mutual_compliance,
    static_compliance,
    turning_compliance,
    turning_stiffness,
)
from monochord.physics.theory.segments import (
    harmonic_frequencies,
    locate_from_segments,
    mixing_matrix,
    open_frequency,
    position_from_far_segment,
    segment_frequencies,
    split_frequencies,
    step_limit,
    tension_from_segments,
)
from monochord.physics.theory.stiffness import (
    Losses,
    bending_stiffness,
    decay_rates,
    inharmonicity,
    outer_diameter,
    partial_numbers,
    stiff_partials,
    support_shortening,
)
from monochord.physics.theory.tension import (
    TensionLaw,
    breaking_force,
    damping_under,
    force_from_tension,
    geometric_tension,
    linear_tension,
    stretch_stiffness,
    tension_from_force,
    wave_speed,
)

__all__ = [
    "Losses",
    "TensionLaw",
    "bending_stiffness",
    "breaking_force",
    "contact_bound",
    "contact_width",
    "damping_under",
    "decay_rates",
    "edge_distance",
    "far_segment_bound",
    "far_segment_sensitivity",
    "force_from_tension",
    "frequency_sensitivities",
    "geometric_tension",
    "harmonic_frequencies",
    "hertz_stiffness",
    "inharmonicity",
    "line_stiffness",
    "linear_tension",
    "loaded_frequencies",
    "locate_from_segments",
    "mindlin_ratio",
    "mixing_matrix",
    "mutual_compliance",
    "open_frequency",
    "outer_diameter",
    "partial_numbers",
    "position_from_far_segment",
    "segment_frequencies",
    "series_bound",
    "split_frequencies",
    "static_compliance",
    "step_limit",
    "stiff_partials",
    "stretch_stiffness",
    "support_shortening",
    "tension_from_force",
    "tension_from_segments",
    "tone_bound",
    "turning_compliance",
    "turning_stiffness",
    "wave_speed",
]
