"""Collect two simulated sessions, build a dataset, split and audit it, and add noise to a batch.

Run it: python examples/build_a_dataset.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import monochord as mc
from monochord.datasets.kinds import KINDS, table_of


def main() -> None:
    """Print the number of windows of each kind, and the properties of a training batch."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        sessions = mc.collect("small", folder / "sessions")
        data = mc.build(sessions, folder / "dataset", split="time", seed=1)
        dataset, split = data.dataset, data.split
        assert mc.audit(data).clean  # `mc.build` refuses a split that leaks

        print(f"{'simulated':<10}" + "".join(f"{kind:>12}" for kind in KINDS))
        for part, objects in table_of(dataset, split).items():
            for counts in objects.values():
                print(f"{part:<10}" + "".join(f"{counts[kind]:>12}" for kind in KINDS))

        train = split.train[dataset.usable[split.train] & dataset.valid["force"][split.train]]
        rows = np.random.default_rng(0).choice(train, 64, replace=False)
        clean = dataset.batch(rows)
        noisy = mc.Augmentation()(clean, rows, seed=1)
        ratio = 20.0 * np.log10(clean.std(axis=(1, 2)) / (noisy - clean).std(axis=(1, 2)))
        force = dataset.label("force")[rows]
        print(f"a batch of {noisy.shape[0]} windows, {noisy.shape[1]} microphones, {noisy.shape[2]} frames")
        print(f"force {force.min():.2f} to {force.max():.2f} N")
        print(f"noise {ratio.min():.0f} to {ratio.max():.0f} dB below the clean sound")


if __name__ == "__main__":
    main()
