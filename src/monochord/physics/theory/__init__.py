"""Closed forms of the touched string: frequencies, their inverse, stiffness, sensitivities and bounds.

Touches are clamps here: they cut the string into two segments that share nothing but the tension. Functions
take plain numbers or, where their signature says so, arrays.
"""

from monochord.physics.theory.bounds import contact_bound, far_segment_bound, series_bound, tone_bound
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
from monochord.physics.theory.sensitivity import far_segment_sensitivity, frequency_sensitivities
from monochord.physics.theory.stiffness import (
    inharmonicity,
    partial_numbers,
    segment_inharmonicity,
    stiff_partials,
)
from monochord.physics.theory.tension import (
    TensionLaw,
    damping_under,
    force_from_tension,
    geometric_tension,
    linear_tension,
    stretch_stiffness,
    tension_from_force,
    wave_speed,
)

__all__ = [
    "TensionLaw",
    "contact_bound",
    "damping_under",
    "far_segment_bound",
    "far_segment_sensitivity",
    "force_from_tension",
    "frequency_sensitivities",
    "geometric_tension",
    "harmonic_frequencies",
    "inharmonicity",
    "linear_tension",
    "locate_from_segments",
    "mixing_matrix",
    "open_frequency",
    "partial_numbers",
    "position_from_far_segment",
    "segment_frequencies",
    "segment_inharmonicity",
    "series_bound",
    "split_frequencies",
    "step_limit",
    "stiff_partials",
    "stretch_stiffness",
    "tension_from_force",
    "tension_from_segments",
    "tone_bound",
    "wave_speed",
]
