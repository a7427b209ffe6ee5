"""The ablation of the reader's memory: its variants, and inputs that one lacks."""

import numpy as np
import pytest

pytest.importorskip("torch")

from studies._memory_training import DENSITY, PARTS, STEPS, Rows
from studies.memory_ablation import PHYSICS, variants, without

from monochord.perception.reader import BANDS, COLUMNS


def test_variants_differ_in_memory_inputs_and_builds() -> None:
    told = variants(1800)
    assert [each.horizon for each in told[:4]] == [1, 16, 80, 0]
    assert all(STEPS % each.horizon == 0 for each in told if each.horizon)
    assert [round(1800 * each.share) for each in told[-2:]] == [300, 1000]
    assert [each.name for each in variants(300)][-1] == "without physics"


def test_inputs_that_a_variant_lacks_are_zero() -> None:
    inputs = np.ones((3, PARTS["hidden"].start + 96), np.float16)
    empty = np.zeros(3, np.float32)
    rows = Rows(
        inputs=inputs,
        density=np.zeros((3, DENSITY), np.float16),
        contact=empty,
        place=empty,
        force=empty,
        slip=empty,
        kind=np.zeros(3, np.int8),
        placed=np.ones(3, bool),
        session=np.zeros(3, np.int32),
    )
    own = without(rows, PHYSICS)
    assert (own.inputs == 0.0).sum() == 3 * (len(COLUMNS) + 3 * BANDS)
    assert (rows.inputs == 1.0).all()
