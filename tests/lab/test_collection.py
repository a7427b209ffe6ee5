from pathlib import Path

import pytest
from tests.lab.tiny import tiny

from monochord.core.errors import InputError
from monochord.lab.assignment import assignments
from monochord.lab.collection import checksum, chosen, collect


@pytest.mark.slow
def test_results_do_not_depend_on_the_number_of_workers(tmp_path: Path) -> None:
    sessions = assignments(tiny())
    alone = list(collect(sessions, tmp_path / "alone", workers=1))
    both = list(collect(sessions, tmp_path / "deep" / "both", workers=2))
    assert {result.name for result in both} == {"hold_000", "slide_000"}
    assert checksum(alone) == checksum(both)
    for result in alone:
        other = tmp_path / "deep" / "both" / result.path.name
        assert result.path.read_bytes() == other.read_bytes()


def test_it_goes_on_where_it_was_cut_off(tmp_path: Path) -> None:
    sessions = assignments(tiny())
    first = next(collect(sessions, tmp_path, workers=1))
    results = {result.name: result for result in collect(sessions, tmp_path, workers=1)}
    assert results[first.name].kept
    assert [result.kept for result in results.values()].count(False) == 1


def test_one_name_is_chosen() -> None:
    assert [one.name for one in chosen(tiny(), only="hold")] == ["hold_000"]
    assert [one.name for one in chosen(tiny(), only="slide_000")] == ["slide_000"]
    assert len(chosen(tiny())) == 2
    with pytest.raises(InputError, match="slides"):
        chosen(tiny(), only="slides")
    with pytest.raises(InputError, match="-1"):
        chosen(tiny(), seed=-1)


def test_a_file_in_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("x")
    with pytest.raises(InputError, match="out"):
        collect(assignments(tiny()), tmp_path / "out")
