"""From sessions to windows with labels: build, split, audit and augment."""

from monochord.datasets.audit import Audit, audit
from monochord.datasets.augment import Augmentation
from monochord.datasets.build import BuildOptions, Labelling, build_dataset, find_sessions
from monochord.datasets.faults import FAULTS, Fault
from monochord.datasets.hearing import heard
from monochord.datasets.split import Split
from monochord.datasets.store import Dataset, open_dataset
from monochord.datasets.truth import MEASURED

__all__ = [
    "FAULTS",
    "MEASURED",
    "Audit",
    "Augmentation",
    "BuildOptions",
    "Dataset",
    "Fault",
    "Labelling",
    "Split",
    "audit",
    "build_dataset",
    "find_sessions",
    "heard",
    "open_dataset",
]
