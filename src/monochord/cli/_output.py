"""What the verbs print."""

import click

from monochord.core.printable import printable


def echo(*lines: str, err: bool = False) -> None:
    """Print lines, on standard error with `err`; whatever they quote, the terminal only prints them."""
    click.echo("\n".join(map(printable, lines)), err=err)  # noqa: TID251  (the one place)
