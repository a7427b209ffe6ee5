"""The curves of a run as events that TensorBoard shows, where it is installed."""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from monochord.core.errors import InputError
from monochord.perception.training.checkpoint import Line

LOSS, MISS = "training/loss", "validation/{}"
"""Names of the curves: the joint loss, and how far off each head is, in the units of ``history.csv``."""


def summary_writer() -> Any:
    """Return the class that writes events; raises `InputError` where TensorBoard is not installed."""
    try:
        from torch.utils.tensorboard import SummaryWriter  # noqa: PLC0415
    except ImportError as error:
        given = "board = true without tensorboard, which is not installed"
        raise InputError(given, "the package tensorboard", "pip install tensorboard") from error
    return SummaryWriter


@contextmanager
def board(folder: Path | None) -> Generator[Callable[[list[Line]], None]]:
    """Give what shows a run's history on TensorBoard, epoch by epoch.

    Each call writes what a history has come to hold since the last one; it is on disk afterwards. The first
    writes all of it, into a new file that says that it takes the place of earlier ones: after a kill the
    curves are whole, and no epoch is shown twice.

    Parameters
    ----------
    folder
        For the events, made with the first epoch. None: write nothing.

    Raises
    ------
    InputError
        If TensorBoard is not installed.

    Examples
    --------
    >>> with board(None) as show:
    ...     show([{"epoch": 1, "loss": 0.5, "force": 0.2}])
    """
    if folder is None:
        yield lambda _: None
        return
    events = _Events(folder, summary_writer())
    try:
        yield events.show
    finally:
        events.close()


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
                    self._writer.add_scalar(LOSS if name == "loss" else MISS.format(name), value, epoch)
        self._shown = len(history)
        if self._writer is not None:
            self._writer.flush()

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()
