"""Collect two simulated sessions, build a dataset, split and audit it, and add noise to a batch.

Run it: python examples/build_a_dataset.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from monochord.datasets.audit import audit
from monochord.datasets.augment import Augmentation
from monochord.datasets.build import build_dataset
from monochord.datasets.kinds import KINDS, table_of
from monochord.datasets.split import split_dataset
from monochord.lab.offline import make
from monochord.lab.plan import assignments
from monochord.lab.plans import load_plan


def main() -> None:
    """Print the number of windows of each kind, and the properties of a training batch."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        sessions = [make(session, folder).path for session in assignments(load_plan("small"))]
        dataset = build_dataset(sessions, folder / "dataset")
        split = split_dataset(dataset, by="time", seed=1)
        audit(dataset, split).refuse_leaks()

        print(f"{'simulated':<10}" + "".join(f"{kind:>12}" for kind in KINDS))
        for part, objects in table_of(dataset, split).items():
            for counts in objects.values():
                print(f"{part:<10}" + "".join(f"{counts[kind]:>12}" for kind in KINDS))

        train = split.train[dataset.usable[split.train] & dataset.valid["force"][split.train]]
        rows = np.random.default_rng(0).choice(train, 64, replace=False)
        clean = dataset.batch(rows)
        noisy = Augmentation()(clean, rows, seed=1)
        ratio = 20.0 * np.log10(clean.std(axis=(1, 2)) / (noisy - clean).std(axis=(1, 2)))
        force = dataset.label("force")[rows]
        print(f"a batch of {noisy.shape[0]} windows, {noisy.shape[1]} microphones, {noisy.shape[2]} frames")
        print(f"force {force.min():.2f} to {force.max():.2f} N")
        print(f"noise {ratio.min():.0f} to {ratio.max():.0f} dB below the clean sound")


if __name__ == "__main__":
    main()
