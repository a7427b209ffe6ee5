"""The benchmark of features of the string's lines."""

from typing import Any

import pytest
from studies.feature_speed import FeaturesBenchmark

from monochord.core.errors import InputError


def test_every_feature_stands_beside_the_plain_transform_and_real_time() -> None:
    names = ("fft_harmonic", "reading")
    rows = {row.name: row for row in FeaturesBenchmark(names=names, count=60).run()}
    assert len(rows) == 2 * 4
    for name in names:
        p50, p95, p99 = (rows[f"{name}, {share}"] for share in ("p50", "p95", "p99"))
        assert 0.0 < p50.value <= p95.value <= p99.value
        assert p50.ratio is not None
        assert 1.0 < p50.ratio < 40.0
        pace = rows[f"{name}, rows in a batch"].ratio
        assert pace is not None
        assert pace > 2.0


@pytest.mark.parametrize("options", [{"count": 0}, {"window": 0.001}, {"names": ("fft_harmonics",)}])
def test_what_cannot_be_is_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        list(FeaturesBenchmark(**options).run())
