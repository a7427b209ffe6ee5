"""The sensor of a bring-up, drawn to scale from its preset, with a part for everything a step is about."""

from monochord.bringup.steps import PADS, PLUCK_PLACE, PRESS_SHARE, TAP_PLACE
from monochord.physics.twin import Sensor

WIDTH, HEIGHT = 360.0, 168.0
"""Size of the drawing; on a phone one unit is about a pixel."""
LEFT, RIGHT = 48.0, 312.0
"""Where the string ends."""
STRING, BAR = 76.0, 132.0
"""Heights of the string and of the bar's top."""
COIL, EDGE = 3.0, 6.0
"""Half the width of a coil, and from a coil to the end of its driver, in the drawing."""
LABEL = "The sensor: microphone 1 at its left end, 2 at its right, and two drivers below the string"


def drawing(sensor: Sensor) -> str:
    """Return the drawing as SVG: from end 1 at the left to end 2, what lies between at its place.

    Each group has a ``data-part`` that a step may light: ``end_1``, ``string``, ``driver_1``, ``driver_2``,
    and the actions ``pluck``, ``tap``, ``press`` and ``damp``, which a page hides while no step lights them.
    The driver's text ends in ``data-switch``, which a page sets to on or off.

    >>> from monochord.physics.sensors import load_sensor
    >>> text = drawing(load_sensor("prototype"))
    >>> text.count("data-part="), text.count('class="coil"')
    (11, 4)
    """
    length = sensor.string.length

    def at(place: float) -> float:
        return LEFT + (RIGHT - LEFT) * place / length

    start, end, press = *(at(each) for each in sensor.range), at(PRESS_SHARE * length)
    pads = "".join(_box(at(each * length) - 15.0, 60.0, 30.0, 15.0, 7.0) for each in PADS)
    parts = [
        _box(start, STRING - 18.0, end - start, 36.0, 4.0, "range"),
        _box(6.0, BAR, WIDTH - 12.0, 8.0, 2.0, "frame"),
        *(_end(number) for number in (1, 2)),
        *(_driver(number, at(each.sense), at(each.drive)) for number, each in enumerate(sensor.drivers, 1)),
        _part("string", f'<line x1="{LEFT:g}" x2="{RIGHT:g}" y1="{STRING:g}" y2="{STRING:g}"/>'),
        _action("pluck", at(PLUCK_PLACE), f'<path d="M{at(PLUCK_PLACE):.1f} 50v20l5 6"/>'),
        _action("tap", at(TAP_PLACE), f'<path d="M{at(TAP_PLACE):.1f} 50v20m-5 -6l5 6l5 -6"/>'),
        _action("press", press, f'<circle cx="{press:.1f}" cy="66" r="9"/>'),
        _action("damp", at(0.5 * length), pads),
    ]
    size = f'viewBox="0 0 {WIDTH:g} {HEIGHT:g}"'
    return f'<svg class="sensor" {size} role="img" aria-label="{LABEL}">{"".join(parts)}</svg>'


def _box(x: float, y: float, width: float, height: float, radius: float, kind: str = "") -> str:
    kind = f' class="{kind}"' if kind else ""
    return f'<rect{kind} x="{x:.1f}" y="{y:g}" width="{width:.1f}" height="{height:g}" rx="{radius:g}"/>'


def _part(name: str, content: str, kind: str = "part") -> str:
    return f'<g class="{kind}" data-part="{name}">{content}</g>'


def _end(number: int) -> str:
    """Return the block and the microphone of an end."""
    outer, edge, anchor = (LEFT - 40.0, 2.0, "start") if number == 1 else (RIGHT + 2.0, WIDTH - 2.0, "end")
    x, y = f"{outer + 19.0:g}", STRING + 32.0
    block = _box(outer, STRING + 4.0, 38.0, BAR - STRING - 4.0, 3.0)
    microphone = "".join(f'<circle cx="{x}" cy="{y:g}" r="{radius}"/>' for radius in (12, 7))
    lead = f'<line class="lead" x1="{x}" x2="{x}" y1="19" y2="{y - 14.0:g}"/>'
    text = f'<text x="{edge:g}" y="14" text-anchor="{anchor}">microphone {number}</text>'
    return _part(f"end_{number}", block) + _part(f"microphone_{number}", lead + microphone + text)


def _driver(number: int, sense: float, drive: float) -> str:
    """Return a driver with both its coils below the string."""
    left, right = min(sense, drive) - EDGE, max(sense, drive) + EDGE
    coils = "".join(_box(x - COIL, STRING + 8.0, 2.0 * COIL, 14.0, 1.0, "coil") for x in (sense, drive))
    case = _box(left, STRING + 14.0, right - left, 24.0, 4.0)
    middle = f'x="{(left + right) / 2.0:.1f}" y="154" text-anchor="middle"'
    text = f'<text {middle}>driver {number}<tspan data-switch="{number}"></tspan></text>'
    return _part(f"driver_{number}", case + coils + text)


def _action(name: str, x: float, mark: str) -> str:
    """Return the mark of what a hand does, with its name over it."""
    return _part(name, f'{mark}<text x="{x:.1f}" y="44" text-anchor="middle">{name}</text>', "part action")
