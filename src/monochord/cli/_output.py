"""What the commands print."""

import click

from monochord.core.printable import printable


def echo(*lines: str, err: bool = False) -> None:
    """Print lines, on standard error with `err`; nothing that they quote controls the terminal."""
    click.echo("\n".join(map(printable, lines)), err=err)  # noqa: TID251  (the one place)
