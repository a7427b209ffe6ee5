"""Forests of regression trees as one array of nodes: scikit-learn learns them, and sums need NumPy alone.

References
----------
Geurts, Ernst and Wehenkel (2006), Extremely randomized trees, Mach. Learn. 63, 3.
"""

import numpy as np

from monochord.core.kernels import kernel
from monochord.core.types import Audio, Floats

TREES = 50
"""Number of trees in a forest."""
NO_FOREST: Audio = np.zeros((0, 3), np.float32)
"""The nodes of no tree."""


def forest_of(rows: Floats | Audio, target: Floats) -> Audio:
    """Return the nodes (n, 3) of extremely randomized trees whose sum gives the targets (k,) of rows (k, v).

    A node has a column, a threshold and the node to go on with if the column's value lies above; otherwise
    the next one follows. A leaf has column -1, what it adds to the sum, and the root of the next tree.

    Examples
    --------
    >>> rows = np.linspace(0.0, 1.0, 40)[:, np.newaxis]
    >>> nodes = forest_of(rows, np.where(rows[:, 0] > 0.5, 1.0, -1.0))
    >>> (forest_sums(np.array([[0.1], [0.9]]), nodes) > 0.0).tolist()
    [False, True]
    """
    from sklearn.ensemble import ExtraTreesRegressor  # noqa: PLC0415

    forest = ExtraTreesRegressor(TREES, max_features=0.3, min_samples_leaf=2, random_state=0)
    forest.fit(rows, target)
    parts, count = list[Floats](), 0
    for tree in (each.tree_ for each in forest.estimators_):
        leaf, end = tree.children_right < 0, count + tree.node_count
        value = np.where(leaf, tree.value[:, 0, 0] / TREES, tree.threshold)
        parts.append(
            np.stack(
                [np.where(leaf, -1, tree.feature), value, np.where(leaf, end, count + tree.children_right)],
                axis=1,
            )
        )
        count = end
    return np.concatenate(parts).astype(np.float32)


@kernel()
def forest_sums(rows: Floats, nodes: Audio) -> Floats:
    """Return the sum (k,) of the leaves that rows (k, v) reach; any nodes end, and read no further."""
    sums = np.zeros(rows.shape[0])
    for row in range(rows.shape[0]):
        k = 0
        while k < nodes.shape[0]:
            column, further = min(int(nodes[k, 0]), rows.shape[1] - 1), max(int(nodes[k, 2]), k + 1)
            if column < 0:
                sums[row] += nodes[k, 1]
            k = k + 1 if column >= 0 and rows[row, column] <= nodes[k, 1] else further
    return sums
