"""The folder of a training run, which is complete in itself.

::

    config.toml              all settings with their values
    checkpoint.safetensors   the state after the last epoch
    history.csv              a line for each epoch
    model/                   the trained model, calibrated
    metrics.json             the scores on validation; written last, so it marks a finished run
    board/                   TensorBoard events, with board = true
    learning.svg             a plot of the history, from ``monochord train`` at the end of a run
"""

import csv
import json
from collections.abc import Callable, Generator, Mapping
from contextlib import closing, contextmanager
from io import StringIO
from pathlib import Path
from typing import Any

from monochord.core.config import Tree, dump_toml, load_toml
from monochord.core.errors import InputError, required
from monochord.core.files import write_text
from monochord.perception.training.checkpoint import Line

CONFIG, METRICS, HISTORY = "config.toml", "metrics.json", "history.csv"
CHECKPOINT, BOARD = "checkpoint.safetensors", "board"
LOSS, ERROR = "training/loss", "validation/{}"
"""Names of TensorBoard curves: the joint loss, and the error of each head in the units of ``history.csv``."""


def claim(out: Path, resolved: Tree) -> None:
    """Create the folder of a run with these settings, or check an existing one.

    Raises `InputError` if the folder holds a run with other settings, or something else.
    """
    file, text = out / CONFIG, dump_toml(resolved)
    if file.is_file():
        if dump_toml(load_toml(file)) != text:
            given = f"{out}, a run with other settings"
            raise InputError(given, "a new folder, or a run with the same config.toml", "name another --out")
        return
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out}, which is not a training run", "a new folder, or the folder of a run")
    out.mkdir(parents=True, exist_ok=True)
    write_text(file, text)


def write_history(out: Path, history: list[Line]) -> None:
    """Write the history: for each epoch, the joint loss and the error of each head on validation."""
    text = StringIO()
    writer = csv.DictWriter(text, list(history[0]) if history else ["epoch"], lineterminator="\n")
    writer.writeheader()
    writer.writerows(history)
    write_text(out / HISTORY, text.getvalue())


def write_metrics(out: Path, metrics: Mapping[str, Any]) -> None:
    """Write the scores of the run."""
    write_text(out / METRICS, json.dumps(metrics, indent=1, ensure_ascii=False) + "\n")


def summary_writer() -> Any:
    """Return TensorBoard's event writer; raises `MissingLibraryError` if TensorBoard is not installed."""
    with required("board = true", "tensorboard", "tensorboard"):
        from torch.utils.tensorboard import SummaryWriter  # noqa: PLC0415
    return SummaryWriter


@contextmanager
def board(folder: Path | None) -> Generator[Callable[[list[Line]], None]]:
    """Yield a function that writes a run's history for TensorBoard; without a folder it writes nothing.

    Each call writes the epochs since the previous call to disk. The first call writes the whole history to a
    new file that replaces earlier files, so a resumed run shows every epoch once. Raises `InputError` if
    TensorBoard is not installed.

    >>> with board(None) as show:
    ...     show([{"epoch": 1, "loss": 0.5, "force": 0.2}])
    """
    if folder is None:
        yield lambda _: None
        return
    with closing(_Events(folder, summary_writer())) as events:
        yield events.show


class _Events:
    def __init__(self, folder: Path, kind: Any) -> None:
        self._folder, self._kind = folder, kind
        self._writer: Any = None
        self._shown = 0

    def show(self, history: list[Line]) -> None:
        for line in history[self._shown :]:
            epoch = int(line["epoch"])
            if self._writer is None:  # TensorBoard forgets what it has read from this epoch on
                self._writer = self._kind(str(self._folder), purge_step=epoch)
            for name, value in line.items():
                if name != "epoch":
                    self._writer.add_scalar(LOSS if name == "loss" else ERROR.format(name), value, epoch)
        self._shown = len(history)
        if self._writer is not None:
            self._writer.flush()

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()
