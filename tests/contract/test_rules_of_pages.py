"""Every page gives the same rule for what people do at the bench: how to tap, and how to measure a length."""

import re
from pathlib import Path

import pytest
from tests.contract.test_layout import PAGES, ROOT

from monochord.bringup import STEPS
from monochord.bringup.steps import TAP_PLACE
from monochord.cli import run
from monochord.physics.sensors import HOW_LONG
from monochord.sessions.alignment import Limits
from monochord.sessions.sync.taps import HOW_TO_TAP, MIN_TAPS, TAPS

NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
COUNT = rf"({'|'.join(NUMBERS[1:])}|\d+)"
TEXTS = {
    page: " ".join(text.replace("*", "").split())
    for page, text in PAGES.items()
    if page.name not in {"ROADMAP.md", "CHANGELOG.md"}
} | {
    page: " ".join(page.read_text(encoding="utf-8").replace("*", "").split())
    for page in sorted((ROOT / "hardware").rglob("*.md"))
}
MEASURING = (
    "docs/how-to/bring-up.md",
    "docs/how-to/tune.md",
    "docs/how-to/identify.md",
    "hardware/assembly.md",
)


def number(word: str) -> int:
    return NUMBERS.index(word.lower()) if word.lower() in NUMBERS else int(word)


def test_all_pages_ask_for_the_same_taps() -> None:
    rule = HOW_TO_TAP.replace(str(TAPS), NUMBERS[TAPS])
    requests = [
        (page.name, found.group(0).lower())
        for page, text in TEXTS.items()
        for found in re.finditer(rf"[Tt]ap the string {COUNT} times.{{0,80}}", text)
    ]
    assert {page for page, _ in requests} >= {"one-clock.md", "record.md", "robot.md"}
    assert [each for each in requests if not each[1].startswith(rule)] == []


def test_no_page_names_another_number_of_taps() -> None:
    counted = [
        (page, number(word), rest)
        for page, text in TEXTS.items()
        for word, rest in re.findall(rf"\b{COUNT} (?:sharp )?taps\b(.{{0,40}})", text, re.IGNORECASE)
    ]
    for page, count, rest in counted:
        is_the_message = count == MIN_TAPS - 1 and f"{MIN_TAPS} are needed" in rest
        assert count == MIN_TAPS or is_the_message, (page, count)
    assert {page.name for page, *_ in counted} >= {"one-clock.md", "collect.md"}
    assert Limits().taps == MIN_TAPS


def test_the_tap_of_a_bring_up_is_at_one_place() -> None:
    place = f"within {1e3 * TAP_PLACE:g} mm of microphone 1's end"
    step = next(each for each in STEPS if each.name == "tap")
    assert step.instruction.startswith("Drivers off. Tap the string once")
    assert place in step.instruction
    assert place in TEXTS[ROOT / "docs/how-to/build-a-sensor.md"]


@pytest.mark.parametrize("command", ["tune", "identify"])
def test_help_texts_measure_a_length_as_the_pages_do(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([command, "--help"]) == 0
    assert HOW_LONG in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("page", MEASURING)
def test_pages_measure_a_length_in_one_way(page: str) -> None:
    assert HOW_LONG in TEXTS[ROOT / page]
    way = re.compile(r"measure[^.]{0,60}\bend to end\b", re.IGNORECASE)
    others = [each for each, text in TEXTS.items() if way.search(text)]
    assert others == list[Path]()
