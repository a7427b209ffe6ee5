"""Checks a dataset's split for leaks, like ``monochord audit``."""

from pathlib import Path

from monochord.core.ranges import checked
from monochord.datasets.audit import Audit
from monochord.datasets.audit import audit as audit_split
from monochord.datasets.split import SPLIT_FILE, Split
from monochord.datasets.store import Dataset, open_dataset
from monochord.perception.data import LabelledData


@checked
def audit(data: LabelledData | Dataset | str | Path, split: str | Path | Split | None = None) -> Audit:
    """Check a dataset for leaks between training, validation and test.

    A leak is a window, a sample, a session, a day or an object shared by two parts, a guard gap that is too
    small, or a duplicate recording: renamed, shifted, scaled or with noise added.

    Parameters
    ----------
    data
        The result of `build` or `load_dataset`, or the dataset's folder.
    split
        Split to check; by default the dataset's own.

    Returns
    -------
    Audit
        The audit with `leaks`, `notes` and `clean`; its `refuse_leaks` raises on a leak.

    Raises
    ------
    InputError
        If the dataset or the split is missing or damaged.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import monochord as mc
    >>> folder, twin = mkdtemp(), ["groups=[{name='hold', grid=[2, 1], hold=0.3}]"]
    >>> data = mc.build(mc.collect("quick", folder, settings=twin), f"{folder}/dataset")
    >>> mc.audit(data).clean
    True
    """
    if isinstance(split, str | Path):
        split = Split.read(Path(split))
    if isinstance(data, LabelledData):
        return audit_split(data.dataset, split or data.split)
    dataset = data if isinstance(data, Dataset) else open_dataset(Path(data))
    return audit_split(dataset, split or Split.read(dataset.path / SPLIT_FILE))
