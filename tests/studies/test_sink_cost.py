"""The benchmark of the sinks' processor time."""

import pytest
from studies.sink_cost import SinkCost

from monochord.core.errors import InputError


@pytest.mark.slow
@pytest.mark.real_time
def test_a_sink_that_nobody_reads_costs_less() -> None:
    rows = {row.name: row.value for row in SinkCost(strings=(1,), windows=100).run()}
    assert all(value > 0.0 for value in rows.values())
    assert rows["ros2, not read, strings: 1"] < 0.7 * rows["ros2, every window read, strings: 1"]


def test_no_strings_are_refused() -> None:
    with pytest.raises(InputError, match="strings"):
        SinkCost(strings=(0,))
