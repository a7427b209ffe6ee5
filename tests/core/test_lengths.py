"""A length in millimetres is asked back, wherever metres are expected: in commands and in functions."""

from collections.abc import Callable, Iterator
from typing import Any

import click
import pytest
from tests.cli.running import Capture, refusal

import monochord as mc
from monochord.cli import monochord
from monochord.core.errors import InputError

LENGTHS = {
    "locate take.wav --length 650": "0.65",
    "locate take.wav --length 0.65 --open A2 --calibrate take.wav:163": "0.163",
    "identify take.wav --length 0.2 --length-error 500": "0.5",
    "design --gap 1500": "1.5",
    "record out.mcap --radius 3000": "3",
    "simulate appendix --at 227.5": "0.2275",
}
CALLS: dict[str, tuple[Callable[[], Any], str]] = {
    "locate": (lambda: mc.locate("take.wav", length=650.0, open="A2"), "0.65"),
    "calibrate": (
        lambda: mc.locate("take.wav", length=0.65, open="A2", calibrate={"take.wav": 163.0}),
        "0.163",
    ),
    "tune": (lambda: mc.tune("twin", length=198.3), "0.1983"),
    "identify": (lambda: mc.identify("take.wav", length=200.0), "0.2"),
    "design": (lambda: mc.design(length=200.0), "0.2"),
    "simulate": (lambda: mc.simulate("appendix", position=227.5), "0.2275"),
    "press": (lambda: mc.VirtualSensor("prototype").press(80.0, 1.0), "0.08"),
    "locate_from_segments": (lambda: mc.locate_from_segments(650.0, 695.0, 374.2), "0.65"),
}


@pytest.mark.parametrize("command", LENGTHS)
def test_a_command_asks_millimetres_back(command: str, capsys: Capture) -> None:
    assert f"did you mean {LENGTHS[command]}?" in refusal(capsys, *command.split())


@pytest.mark.parametrize("name", CALLS)
def test_a_function_asks_millimetres_back(name: str) -> None:
    call, meant = CALLS[name]
    with pytest.raises(InputError) as caught:
        call()
    assert f"did you mean {meant}" in caught.value.remedy


def options_in_metres(command: click.Command) -> Iterator[click.Parameter]:
    """Yield the options in metres of a command and of the commands in it."""
    yield from (option for option in command.params if option.metavar == "M")
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            inner = command.get_command(context, name)
            assert inner is not None
            yield from options_in_metres(inner)


def test_every_option_in_metres_has_the_rule() -> None:
    options = [option for option in options_in_metres(monochord) if option.name != "at"]
    assert len(options) > 10  # a position, --at, is checked with its string
    for option in options:
        with pytest.raises(click.BadParameter, match=r"did you mean 0\.65\?"):
            option.type.convert("650", option, None)
