"""The folder of a training run: it needs nothing else to be understood, or to be gone on with.

::

    config.toml              every setting, with its value
    checkpoint.safetensors   where training stands
    history.csv              a line for each epoch
    model/               what was learned, calibrated
    metrics.json             how good it is on validation; written last, so that it marks a run that is done
    board/                   TensorBoard's events, where they were asked for
    learning.svg             the history drawn, by ``monochord train`` when a run is done
"""

import csv
import json
import os
from collections.abc import Mapping
from io import StringIO
from pathlib import Path
from typing import Any

from monochord.core.config import Tree, dump_toml, load_toml
from monochord.core.errors import InputError
from monochord.perception.training.checkpoint import Line

CONFIG, METRICS, HISTORY = "config.toml", "metrics.json", "history.csv"
CHECKPOINT, BOARD = "checkpoint.safetensors", "board"


def claim(out: Path, resolved: Tree) -> None:
    """Make a folder that of a run with these settings, or find that it is.

    Raises
    ------
    InputError
        If it holds a run with other settings, or something else.
    """
    file, text = out / CONFIG, dump_toml(resolved)
    if file.is_file():
        if dump_toml(load_toml(file)) != text:
            given = f"{out}, a run with other settings"
            raise InputError(
                given, "a new folder, or one whose config.toml is the same", "name another --out"
            )
        return
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out}, which is something else", "a new folder, or that of a run")
    out.mkdir(parents=True, exist_ok=True)
    _replace(file, text)


def write_history(out: Path, history: list[Line]) -> None:
    """Write a line for each epoch: the joint loss, and how far off each head is on validation."""
    text = StringIO()
    writer = csv.DictWriter(text, list(history[0]) if history else ["epoch"], lineterminator="\n")
    writer.writeheader()
    writer.writerows(history)
    _replace(out / HISTORY, text.getvalue())


def write_metrics(out: Path, metrics: Mapping[str, Any]) -> None:
    """Write what the run came to."""
    _replace(out / METRICS, json.dumps(metrics, indent=1, ensure_ascii=False) + "\n")


def _replace(file: Path, text: str) -> None:
    part = file.with_name(f".{file.name}.part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, file)  # noqa: PTH105  (what stood there is replaced at once)
