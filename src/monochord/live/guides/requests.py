"""What a page may ask of the guided steps."""

from typing import Annotated, Literal, TypeAlias

import msgspec

from monochord.physics.known_touches import Unit

TouchAct: TypeAlias = Literal["announce", "undo", "skip"]
"""What a person may do with a touch beside giving its position and force."""


class Record(msgspec.Struct, tag_field="do", tag="record", forbid_unknown_fields=True):
    """Start or end a recording."""

    on: bool


class Tune(msgspec.Struct, tag_field="do", tag="tune", forbid_unknown_fields=True):
    """Tune the sensor."""


class Calibrate(msgspec.Struct, tag_field="do", tag="calibrate", forbid_unknown_fields=True):
    """Calibrate the model with a number of touches."""

    touches: Annotated[int, msgspec.Meta(ge=3, le=30)]


class Label(msgspec.Struct, tag_field="do", tag="label", forbid_unknown_fields=True):
    """Record a number of touches with labels."""

    touches: Annotated[int, msgspec.Meta(ge=1, le=100)]


class Hold(msgspec.Struct, tag_field="do", tag="hold", forbid_unknown_fields=True):
    """State the present touch's position in m and force in a unit; null for one that was not measured."""

    position: float | None
    force: float | None
    unit: Unit = "N"


class TouchStep(msgspec.Struct, tag_field="do", tag="step", forbid_unknown_fields=True):
    """Announce, undo or skip a touch."""

    act: TouchAct


class Cancel(msgspec.Struct, tag_field="do", tag="cancel", forbid_unknown_fields=True):
    """End a guided step."""
