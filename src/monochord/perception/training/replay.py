"""A model on windows of a dataset, one after the other, as it would hear them live."""

from collections.abc import Iterator

from monochord.core.types import Window
from monochord.core.units import Samples
from monochord.datasets.store import Dataset, Indices
from monochord.perception.model.context import Memory
from monochord.perception.model.model import Prepared
from monochord.perception.model.network import Answer


def replay(prepared: Prepared, dataset: Dataset, rows: Indices) -> Iterator[tuple[int, dict[str, Answer]]]:
    """Yield each row with what every head answers for its window; nothing for one that cannot be used.

    Parameters
    ----------
    prepared
        A model, ready for the dataset's signal.
    dataset
        What the windows are of.
    rows
        Windows (n,) in the order of their sessions and of time; a session begins with an empty memory.
    """
    memory, session = Memory(), -1
    for row in rows.tolist():
        if dataset.session[row] != session:
            memory, session = Memory(), int(dataset.session[row])
        memory, found = prepared.answers(memory, window_of(dataset, row))
        yield row, dict(found)


def window_of(dataset: Dataset, row: int) -> Window:
    """Return a window of a dataset as a source would give it, in samples of its own."""
    start: Samples = int(dataset.start[row])
    return Window(
        samples=dataset.window(row).copy(),
        start=start,
        sample_rate=dataset.manifest.sample_rate,
        has_gap=bool(dataset.has_gap[row]),
    )
