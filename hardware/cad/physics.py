"""The figures behind the dimensions of one build, as its report and its pages state them."""

from math import degrees

from hardware.cad import coil, mechanics
from hardware.cad.crosstalk import feedthrough
from hardware.cad.ebow import room_above, room_below
from hardware.cad.parameters import Hardware


def physics(hardware: Hardware) -> dict[str, float]:
    """Return each figure by its name, which ends in its unit.

    Examples
    --------
    >>> from hardware.cad.parameters import load_hardware
    >>> figures = physics(load_hardware("prototype"))
    >>> round(figures["break_angle_deg"], 1), round(figures["saddle_force_N"], 1)
    (6.1, 7.0)
    """
    string, height = hardware.sensor.string, 1e-3 * hardware.string_height
    bar = {"width": 1e-3 * hardware.bar_width, "thickness": 1e-3 * hardware.bar_thickness, "height": height}
    block = {"width": 1e-3 * hardware.bar_width, "length": 1e-3 * hardware.block_length, "height": height}
    figures = {
        "tension_N": string.tension,
        "stress_MPa": mechanics.stress(string) / 1e6,
        "break_angle_deg": degrees(hardware.break_angle),
        "saddle_force_N": mechanics.downforce(string, hardware.break_angle),
        "swing_mm": 1e3 * mechanics.swing(hardware.sensor),
        "sag_2N_mm": hardware.sag,
        "pole_clearance_mm": hardware.pole_clearance,
        "string_height_mm": hardware.string_height,
        "cents_per_um": 1e-6 * mechanics.cents_per_metre(string),
    }
    for material in ("steel", "aluminium"):
        bend = mechanics.bar_bend(string, **bar, material=material)
        figures[f"bar_{material}_deflection_um"] = 1e6 * bend.deflection
        figures[f"bar_{material}_approach_um"] = 1e6 * bend.approach
        figures[f"bar_{material}_cents"] = bend.cents
    for material in ("PLA", "aluminium", "steel"):
        figures[f"block_{material}_lean_um"] = 1e6 * mechanics.block_lean(string, **block, material=material)
    for frame in mechanics.EXPANSION:
        for printed in dict.fromkeys((frame, "PLA")):
            drift = mechanics.thermal_cents(string, frame=frame, block=printed, offset=3.5e-3)
            figures[f"drift_{frame}_with_{printed}_blocks_cents_per_K"] = drift
    winding = coil.winding(hardware)
    force = coil.pull(hardware, clearance=1e-3 * hardware.pole_clearance)
    figures |= {
        "coil_awg": winding.awg,
        "coil_turns": winding.turns,
        "coil_ohm": winding.resistance,
        "coil_mH_without_core": 1e3 * winding.inductance,
        "coil_mN_per_A_estimate": 1e3 * force.per_ampere,
        "magnet_pull_mN_estimate": 1e3 * force.static,
        "magnet_stiffness_N_per_m_estimate": force.stiffness,
        "feedthrough_1_dB_estimate": feedthrough(hardware, 0),
        "feedthrough_2_dB_estimate": feedthrough(hardware, 1),
        "limit_mN": 1e3 * max(each.limit for each in hardware.sensor.drivers),
    }
    below, above = room_below(hardware), room_above(hardware)
    return figures | {
        "ebow_coil_spacing_mm": below.spacing,
        "ebow_longest_case_below_mm": below.length,
        "ebow_longest_case_above_mm": above.length,
    }
