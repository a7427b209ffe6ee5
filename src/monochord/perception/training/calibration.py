"""A model adapted to one build by sessions of known touches: what ``monochord calibrate`` does."""

import dataclasses
import tempfile
from collections.abc import Iterable
from pathlib import Path

from monochord.core.errors import InputError
from monochord.datasets.build import BuildOptions, Labelling, build_dataset, find_sessions
from monochord.perception.model import load, save
from monochord.perception.training.adapt import Adaptation, Objects, adapt, judge
from monochord.perception.training.rows import Progress
from monochord.perception.tuning.sessions import tension_estimator


def calibrated(
    model: str,
    sessions: Iterable[str],
    out: Path | None,
    *,
    touches: int | None = None,
    objects: Objects = "same",
    labels: Labelling = "",
    force: bool = False,
    progress: Progress = lambda *_: None,
) -> Adaptation:
    """Adapt a model to one sensor and object, and save the result; without touches to use, judge it alone.

    Parameters
    ----------
    model
        Folder of a model, or the name of a bundled one.
    sessions
        Files, folders or patterns of sessions with known touches.
    out
        Folder of the new model; None, with no touch to use, for none.
    touches
        How many touches to use, the first in time; all by default. With 0 the model stays as it is, and all
        touches say how good it is.
    objects
        What the sensor is to be touched by: the object of these touches, or others too; see `adapt`.
    labels
        Which labels to take; see `BuildOptions`.
    force
        Whether to accept sessions whose streams are not on one clock.
    progress
        Called with the progress.

    Raises
    ------
    InputError
        If the folder exists, or is needed and not given, or the model or the sessions cannot be used; see
        `adapt`.
    """
    given = load(model)
    if touches == 0 and objects == "others":
        raise InputError(
            "--objects others with --touches 0", "touches to learn from", "leave one of both out"
        )
    if out is None and touches != 0:
        raise InputError("no --out", "a new folder for the model", "or --touches 0, which judges it alone")
    if out is not None and out.exists():
        raise InputError(f"folder {out} (exists)", "a new folder", "choose another name with --out")
    trained = given.definition
    rate = trained.sample_rate
    options = BuildOptions(window=trained.window / rate, hop=trained.hop / rate, labels=labels, force=force)
    with tempfile.TemporaryDirectory() as folder:
        dataset = build_dataset(
            find_sessions(sessions),
            Path(folder) / "dataset",
            options,
            listen=tension_estimator(trained.string),
        )
        if touches == 0:
            result = judge(given, dataset, progress=progress)
        else:
            result = adapt(given, dataset, touches=touches, objects=objects, progress=progress)
    return result if out is None else dataclasses.replace(result, model=save(result.model, out))
