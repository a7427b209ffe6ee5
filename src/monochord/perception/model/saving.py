"""Saves a model in a folder, which `monochord.perception.model.files` reads."""

import dataclasses
import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from monochord.core.config import to_tree
from monochord.core.files import replacing
from monochord.core.ownership import part_folder
from monochord.core.types import Audio
from monochord.perception.model.definition import Definition

TEXT, WEIGHTS = "model.json", "weights.safetensors"


def save(definition: Definition, weights: Mapping[str, Audio], folder: Path) -> Definition:
    """Save a model in a folder, and return its definition with the checksum of its weights.

    The same model gives the same bytes. The text is written last, so a folder with the text is complete.
    """
    from safetensors.numpy import save as packed  # noqa: PLC0415

    names = definition.shapes()
    blob = packed({name: np.ascontiguousarray(weights[name], np.float32) for name in names})
    definition = dataclasses.replace(definition, weights=hashlib.sha256(blob).hexdigest())
    text = json.dumps(_finite(to_tree(definition)), indent=1, ensure_ascii=False, allow_nan=False)
    content = ((WEIGHTS, blob), (TEXT, text.encode() + b"\n"))
    if folder.exists():
        _write(folder, content)
    else:
        folder.absolute().parent.mkdir(parents=True, exist_ok=True)
        with part_folder(folder) as part:
            _write(part, content)
            part.rename(folder)
    return definition


def _write(folder: Path, content: Iterable[tuple[str, bytes]]) -> None:
    for name, each in content:
        with replacing(folder / name) as part:
            part.write_bytes(each)


def _finite(tree: Any) -> Any:
    """Return a tree without infinities, which JSON does not have."""
    if isinstance(tree, dict):
        return {key: _finite(value) for key, value in tree.items()}
    if isinstance(tree, list):
        return [_finite(value) for value in tree]
    return "inf" if tree == float("inf") else tree
