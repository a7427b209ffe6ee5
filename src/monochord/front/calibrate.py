"""Adapts a model to one sensor with known touches, like ``monochord calibrate``."""

from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from monochord.core.progress import progress_bar
from monochord.core.ranges import Whole, checked
from monochord.core.types import Progress
from monochord.datasets.build import Labelling
from monochord.front.build import Sessions, session_names
from monochord.perception.model import Model
from monochord.perception.training.adapt import Objects
from monochord.perception.training.adaptation import Adaptation
from monochord.perception.training.calibration import calibrated


@dataclass(frozen=True, kw_only=True)
class CalibratedModel(Model):
    """A model adapted to known touches; `calibration` holds its evaluation, and `out` is its folder."""

    calibration: Adaptation = field(repr=False)
    out: Path | None = None

    __repr__ = Model.__repr__

    def tree(self) -> dict[str, Any]:
        """Return the result as plain values."""
        result = self.calibration
        return {
            "path": str(self.out) if self.out else None,
            "simulated": self.definition.simulated,
            "heads": {name: asdict(head) for name, head in result.heads.items()},
            "mistaken": result.mistaken,
            "trust": asdict(result.trust),
            "next_touch": asdict(result.next_touch) if result.next_touch else None,
            "sensing_range": result.sensing_range,
            "outside": result.outside,
            "weights": self.definition.weights,
        }


@checked
def calibrate(
    model: str | Path | Model,
    sessions: Sessions,
    out: str | Path | None = None,
    *,
    touches: Whole | None = None,
    objects: Objects = "same",
    labels: Labelling | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> CalibratedModel:
    """Adapt a model to one sensor and object with a few touches of known position and force.

    All stated errors are cross-validated on held-out touches. The input model is not changed.

    Parameters
    ----------
    model
        A model, its folder, its training run's folder, or a bundled model's name.
    sessions
        Sessions of touches with known position and force: files, folders or patterns.
    out
        Folder of the new model; if omitted, it is not saved.
    touches
        Number of touches to use, the first ones; 0 tests the model on all and changes nothing; by default
        all.
    objects
        Whether the ``"same"`` object will touch the string later, or ``"others"`` too.
    labels
        Labels to use: ``"recorded"`` in the session, or ``"measured"``, derived from force and pose; by
        default recorded, if any.
    force
        Whether to accept sessions whose streams are not on one clock.
    progress
        Called with the progress; by default there is a bar on a terminal and in a notebook.

    Returns
    -------
    CalibratedModel
        The adapted model; its `calibration` has the errors by head, in m and N, the valid range, and the most
        useful next touch.

    Raises
    ------
    InputError
        If `out` exists, or the model or the sessions are unusable.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import monochord as mc
    >>> twin = ["groups=[{name='hold', grid=[2, 1], hold=0.3}]"]
    >>> judged = mc.calibrate("demo", mc.collect("quick", mkdtemp(), settings=twin), touches=0)
    >>> judged.calibration.heads["position"].touches
    2
    """
    folder = Path(out) if out is not None else None
    with progress_bar(progress=progress) as report:
        result = calibrated(
            model if isinstance(model, Model) else str(model),
            session_names(sessions),
            folder,
            touches=touches,
            objects=objects,
            labels=labels or "",
            force=force,
            progress=report,
        )
    known = {each.name: getattr(result.model, each.name) for each in fields(Model)}
    return CalibratedModel(**known, calibration=result, out=folder)
