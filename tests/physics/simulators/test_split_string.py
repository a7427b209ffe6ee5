"""The split string asked for a sound."""

import inspect

import pytest

from monochord.core.errors import InputError
from monochord.core.types import Contact
from monochord.physics.simulators import SIMULATORS, Case, Simulator, Sound
from monochord.physics.strings import load_string

APPENDIX = load_string("appendix")


def run(*assignments: str, contact: Contact | None = APPENDIX.contact) -> Sound:
    case = Case(string=APPENDIX.string, contact=contact, seconds=0.4, assignments=assignments)
    return SIMULATORS.build("split_string", {"route": "modal"}).run(case)


def test_the_folder_is_the_registry() -> None:
    assert "split_string" in SIMULATORS.names()
    assert inspect.isabstract(Simulator)
    with pytest.raises(InputError, match=r"simulator 'split_strin'.*did you mean 'split_string'"):
        SIMULATORS.load("split_strin")
    with pytest.raises(InputError, match="did you mean 'modal'"):
        SIMULATORS.build("split_string", {"route": "modl"})


def test_peaks_stand_beside_theory() -> None:
    sound = run()
    assert sound.summary["theory"] == pytest.approx([695.006, 374.234], abs=1e-3)
    assert sound.summary["peaks"] == pytest.approx(sound.summary["theory"], rel=1e-3)
    assert sound.microphones.shape == (2, 17640)


def test_an_untouched_string_has_its_open_frequency_twice() -> None:
    assert run(contact=None).summary["theory"] == pytest.approx([243.25, 243.25], abs=0.01)


def test_assignments_reach_every_part_of_the_setup() -> None:
    tighter = run("string.tension=80", "contact.force=1.0", "drive.amplitude=0.002", "nodes=64")
    assert (tighter.summary["position"], tighter.summary["force"]) == (0.2275, 1.0)
    assert tighter.summary["theory"][0] == pytest.approx(695.006 * (86.0 / 65.0) ** 0.5, abs=1e-2)
    assert tighter.summary["peaks"] == pytest.approx(tighter.summary["theory"], rel=1e-3)
    assert abs(tighter.microphones).max() > abs(run().microphones).max()


def test_a_silent_segment_has_no_peak() -> None:
    assert run("drive.amplitude=0", "pluck.height=0").summary["peaks"] == [None, None]


@pytest.mark.parametrize(
    ("assignment", "line"),
    [
        ("drive.amplitud=1", "option 'drive.amplitud'.*did you mean 'amplitude'"),
        ("contact.positon=0.1", "option 'contact.positon'.*did you mean 'position'"),
        ("drive.feedback=litteral", "did you mean 'literal'"),
        ("nodes=many", "option 'nodes' = 'many'"),
    ],
)
def test_an_unknown_assignment_is_refused(assignment: str, line: str) -> None:
    with pytest.raises(InputError, match=line):
        run(assignment)
