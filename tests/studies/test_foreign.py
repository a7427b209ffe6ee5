"""Estimators on foreign sensors: what a recording holds, what is scored, and the command's table."""

import numpy as np
import pytest
from click.testing import CliRunner
from studies.foreign import HOP, SIZE, Recording, foreign, of_take, scores
from tests.beam_elements import take


def made_up(contact: list[float], position: list[float]) -> Recording:
    count = len(contact)
    return Recording(
        sound=np.zeros((2, SIZE), np.float32),
        length=0.2,
        starts=list(range(count)),
        contact=np.array(contact),
        position=np.array(position),
        force=np.ones(count),
        steady=np.ones(count),
    )


def test_answers_errors_and_contact_are_counted_over_steady_windows() -> None:
    recording = made_up([1.0, 1.0, 1.0, 0.0], [0.08, 0.08, 0.08, np.nan])
    value = (
        np.array([0.9, 0.8, np.nan, 0.7]),
        np.array([0.081, 0.098, np.nan, 0.1]),
        np.array([1.5, 1.0, 0.5, 1.0]),
    )
    std = np.full(4, 0.1), np.full(4, 2e-3), np.full(4, 0.1)
    row = scores([recording], [(value, std)])
    assert row[0] == "66.7 %"
    assert row[1:3] == ("9.50 mm", "9.50 mm")
    assert row[3:6] == ("50.0 %", "50 %", "0.33 N")
    assert row[6:] == ("75.0 %", "66.7 %")


@pytest.mark.slow
def test_windows_in_which_a_touch_changes_do_not_count() -> None:
    known = take(5, 1)
    recording = of_take(known)
    assert np.diff(recording.starts).tolist() == [HOP] * (len(recording.starts) - 1)
    counted = recording.steady == 1.0
    (begin, end), starts = known.touches[0], np.array(recording.starts)
    across = ((starts < begin) & (starts + SIZE > begin)) | ((starts < end) & (starts + SIZE > end))
    assert across.any()
    assert not counted[across].any()
    assert counted.any()


@pytest.mark.slow
def test_the_command_prints_a_row_of_each_sensor() -> None:
    options = ["--builds", "1", "--touches", "1", "--training", "0", "--seed", "5"]
    options += ["--estimator", "closed_form"]
    result = CliRunner().invoke(foreign, options, catch_exceptions=False)
    lines = result.stdout.splitlines()
    assert lines[0].split()[:2] == ["sensor", "estimator"]
    assert [line.partition("  ")[0] for line in lines[1:]] == [
        "twin, ideal",
        "twin, plausible",
        "finite differences",
        "beam elements",
    ]
