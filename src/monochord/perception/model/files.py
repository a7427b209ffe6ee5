"""A model on disk: a folder with a definition in text and a file of arrays.

::

    model.json               the definition: feature, heads, calibration, training data
    weights.safetensors      the arrays; model.json holds their SHA-256

The folder contains no pickle, so reading a model runs no code. Bundled pretrained models are loaded by name
(`monochord.perception.model.bundled`).
"""

import hashlib
from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from monochord.core.config import from_tree, load_json
from monochord.core.errors import InputError
from monochord.core.files import refuse_endless, similar_name
from monochord.core.ranges import checked
from monochord.core.types import Audio
from monochord.perception.model.bundled import bundled_folder, bundled_names
from monochord.perception.model.definition import FORMAT, OLDEST, Definition
from monochord.perception.model.model import Model
from monochord.perception.model.saving import TEXT, WEIGHTS

INSIDE_A_RUN = "model"
"""Name of the model's folder in the folder of a training run."""
MAX_HEADER = 1 << 20
"""Largest number of bytes in the weights file in addition to the weights."""
AGAIN = "copy the folder again, or train again"
EARLIER_OPTIONS = ("context", "reference", "rise")
"""Options of a head up to format 4, which had a row of the untouched string as input."""
TRAIN_AGAIN = "train it again with this version: monochord train --dataset DATASET --out RUN"


def folder_of(path: Path) -> Path | None:
    """Return the folder of the model that a path names; None if there is no model.

    A path is the folder of a model or of a training run. A path that does not exist is the name of a bundled
    pretrained model.

    >>> folder_of(Path("no-such-run")) is None
    True
    """
    folders = (folder for folder in (path, path / INSIDE_A_RUN) if (folder / TEXT).is_file())
    return next(folders, None if path.exists() else bundled_folder(str(path)))


@checked
def load(path: Path | str) -> Model:
    """Return a model from its folder, from the folder of a training run, or by a bundled model's name.

    Raises
    ------
    InputError
        If there is no model, or a file is damaged, has another checksum or another format.

    Examples
    --------
    >>> load("demo").definition.simulated
    True
    """
    folder = folder_of(Path(path))
    if folder is None:
        names = bundled_names()
        given = f"model {path} ({f'there is no {TEXT} in it' if Path(path).exists() else 'not there'})"
        allowed = f"a folder that monochord train made, or {', '.join(names)}"
        raise InputError(given, allowed, similar_name(path, names))
    definition = _definition(folder / TEXT)
    records = (record.correction for record in definition.heads.values())
    if any(each.residual and not each.nodes for each in records if each):
        given = f"{folder / TEXT}, calibrated by an earlier version"
        raise InputError(given, "a calibration with trees", "calibrate the model again: monochord calibrate")
    file = folder / WEIGHTS
    refuse_endless(file)
    expected = 4 * sum(prod(shape) for shape in definition.shapes().values())
    try:
        if file.stat().st_size > expected + MAX_HEADER:
            given = f"{file} of {file.stat().st_size} bytes"
            raise InputError(given, f"at most {expected + MAX_HEADER} bytes, from {TEXT}", AGAIN)
        blob = file.read_bytes()
    except OSError as error:
        raise InputError(f"{file} ({error.strerror})", "a readable file", AGAIN) from error
    digest = hashlib.sha256(blob).hexdigest()
    if digest != definition.weights:
        given = f"{file} with sha256 {digest[:12]}..."
        raise InputError(given, f"{definition.weights[:12] or '(none)'}..., from {TEXT}", AGAIN)
    return Model(definition=definition, weights=_weights(file, blob, definition))


def _definition(file: Path) -> Definition:
    tree = load_json(file, AGAIN)
    if not isinstance(tree, dict) or tree.get("format") not in range(OLDEST, FORMAT + 1):
        version = tree.get("format") if isinstance(tree, dict) else None
        given = f"{file} of format {version!r:.20}" if version is not None else f"{file} without a format"
        raise InputError(given, f"format {OLDEST} to {FORMAT}", TRAIN_AGAIN)
    try:
        return from_tree(Definition, _of_this_format(_infinite(tree), file), file.name)
    except RecursionError as error:
        raise InputError(f"{file} (nested too deep)", "a file that monochord train wrote", AGAIN) from error


def _of_this_format(tree: dict[str, Any], file: Path) -> dict[str, Any]:
    """Return a definition of an earlier format in this one.

    Up to format 4 there was a row of the untouched string beside that of a window; a model that used it
    cannot be read.
    """
    if tree["format"] == FORMAT:
        return tree
    if tree.pop("reference", None):
        given = f"{file}, of a model that has a row of the untouched string as input"
        raise InputError(given, "one without, or of this version", TRAIN_AGAIN)
    heads = tree.get("heads")
    for head in heads.values() if isinstance(heads, dict) else ():
        task = head.get("task") if isinstance(head, dict) else None
        if isinstance(task, dict):
            for name in EARLIER_OPTIONS:
                task.pop(name, None)
    return {**tree, "format": FORMAT}


def _weights(file: Path, blob: bytes, definition: Definition) -> Mapping[str, Audio]:
    from safetensors import SafetensorError  # noqa: PLC0415
    from safetensors.numpy import load as unpacked  # noqa: PLC0415

    try:
        arrays = unpacked(blob)
    except (SafetensorError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{file} (damaged)", "a safetensors file", AGAIN) from error
    for name, shape in definition.shapes().items():
        array = arrays.get(name)
        is_there = array is not None and array.shape == shape and array.dtype == np.float32
        if array is None or not is_there or not np.isfinite(array).all():
            wrong = (
                "absent"
                if array is None
                else f"{array.dtype} {array.shape}"
                if not is_there
                else "not finite"
            )
            raise InputError(f"{file}: {name} is {wrong}", f"finite float32 {shape}", AGAIN)
        if name.endswith(".scale") and not (array > 0.0).all():
            raise InputError(f"{file}: {name} is 0 or less somewhere", "above 0", AGAIN)
    return {name: arrays[name] for name in definition.shapes()}


def _infinite(tree: Any) -> Any:
    """Return a tree as it was before it was saved."""
    if isinstance(tree, dict):
        return {key: _infinite(value) for key, value in tree.items()}
    if isinstance(tree, list):
        return [_infinite(value) for value in tree]
    return float("inf") if tree == "inf" else tree
