"""Tables of features by object: the paper's row above, an abstention shown as what it is."""

from typing import Any

from monochord.evaluation.paper_page import paper_page


def row(feature: str, body: str, condition: str = "clean", **other: Any) -> dict[str, Any]:
    told = {"position_mae_mm": 0.4, "position_within_5mm": 0.99, "position_r": 0.999}
    told |= {"force_mae_n": 0.08, "force_within_0_2n": 0.9, "force_r": 0.97}
    told |= {"contact_accuracy": 0.995, "slip_auc": 0.97, "n": 10, "simulated": True}
    return {"feature": feature, "object": body, "condition": condition} | told | other


def test_the_papers_own_row_stands_above_those_of_its_objects() -> None:
    lines = paper_page([row("mine", "wood"), row("mine", "plastic"), row("mine", "brick")]).splitlines()
    at = lines.index("## Position, clean")
    assert lines[at + 2] == "| feature | plastic | wood | brick |"
    assert (
        lines[at + 4]
        == "| *the paper's sensor (real)* | *2.7 mm, 87.8%, 0.994* | *8.8 mm, 51.4%, 0.863* | - |"
    )
    assert lines[at + 5].startswith("| mine | 0.4 mm, 99.0%, 0.999 |")
    assert "simulated" in lines[2]


def test_what_was_not_told_is_a_dash() -> None:
    rows = [row("mine", "wood", slip_auc=None), row("other", "wood", force_mae_n=None)]
    page = paper_page(rows)
    assert "| other | - |" in page
    assert "| mine | - |" in page[page.index("## Slip") :]


def test_contact_is_that_of_all_objects_where_there_are_several() -> None:
    rows = [row("mine", "wood", contact_accuracy=0.5), row("mine", "all objects", contact_accuracy=0.75)]
    assert "| mine | 75.0% |" in paper_page(rows)


def test_real_sound_is_not_called_simulated() -> None:
    assert "All sound is simulated" not in paper_page([row("mine", "wood", simulated=False)])
