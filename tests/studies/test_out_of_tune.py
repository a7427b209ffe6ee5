"""A string within a tenth of its pitch is read as one in tune; one further off states no wrong place."""

import pytest
from studies.out_of_tune import OutOfTune


@pytest.mark.slow
def test_places_are_told_on_a_string_five_percent_flat_and_withheld_on_one_twenty_percent_flat() -> None:
    values = {row.name: row.value for row in OutOfTune(off=(-0.2, -0.05), builds=(77,)).run()}
    assert values["-5 %: position answered"] > 95.0
    assert values["-5 %: untouched called touched"] == 0.0
    assert values["-20 %: position answered"] < 5.0
    assert values["-5 %: more than 5 mm off"] == values["-20 %: more than 5 mm off"] == 0.0
