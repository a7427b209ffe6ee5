"""Printing of the commands."""

import click

from monochord.core.printable import printable


def echo(*lines: str, err: bool = False) -> None:
    """Print lines, on standard error with `err`; quoted text cannot control the terminal."""
    click.echo("\n".join(map(printable, lines)), err=err)  # noqa: TID251  (the one place)
