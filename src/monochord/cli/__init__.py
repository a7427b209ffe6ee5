"""The command line: one file a verb, found by its name; arguments and printing only.

Every verb ends with status 0 only if its work was done, and with 2 and one line on stderr for a bad
argument or input. Importing this module is cheap: a verb's file loads when the verb is used.
"""

import sys
from importlib import import_module
from pkgutil import iter_modules

import click

from monochord.errors import DeviceError, InputError, MonochordError, did_you_mean


class _Verbs(click.Group):
    """The verbs of this folder: each file holds one command of the file's name."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        found = (module.name for module in iter_modules(__path__))
        return sorted(name for name in found if not name.startswith("_"))

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        verbs = self.list_commands(ctx)
        if cmd_name not in verbs:
            raise InputError(f"verb '{cmd_name}'", ", ".join(verbs), did_you_mean(cmd_name, verbs))
        return getattr(import_module(f"{__name__}.{cmd_name}"), cmd_name)


@click.group(cls=_Verbs, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="monochord")
def monochord() -> None:
    """Monochord: acoustic tactile sensing with a driven string."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 2 bad argument or input, 1 a device failed, 130 interrupted."""
    sys.exit(run(sys.argv[1:] if arguments is None else arguments))


def run(arguments: list[str]) -> int:
    """Run the command line and return its exit status, printing any error as one line on stderr."""
    try:
        result = monochord.main(arguments, prog_name="monochord", standalone_mode=False)
    except click.UsageError as error:
        verb = error.ctx.command_path if error.ctx else "monochord"
        return _say(f"{error.format_message()} (see '{verb} --help')", 2)
    except (InputError, DeviceError) as error:
        return _say(str(error), 2)
    except MonochordError as error:
        return _say(str(error), 1)
    except (KeyboardInterrupt, click.Abort):
        return 130
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    return result if isinstance(result, int) else 0


def _say(line: str, status: int) -> int:
    click.echo("monochord: " + " ".join(line.split()), err=True)
    return status
