"""The command line: one file a verb, found by its name; arguments and printing only.

Every verb ends with status 0 only if its work was done, and with 2 and one line on stderr for a bad
argument or input. Importing this module is cheap, and so is asking for help: a verb's file loads when
the verb is used.
"""

import ast
import errno
import os
import sys
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from pkgutil import iter_modules

import click

from monochord.errors import DeviceError, InputError, MonochordError, did_you_mean

INTERRUPTED = 130
"""Exit status of a verb that Control-C cut off."""
_ROOM = "make room there, or write elsewhere"
_NOT_WRITTEN = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


class _Verbs(click.Group):
    """The verbs of this folder: each file holds one command of the file's name."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        found = (module.name for module in iter_modules(__path__))
        return sorted(name for name in found if not name.startswith("_"))

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        verbs = self.list_commands(ctx)
        if cmd_name not in verbs:
            raise InputError(f"verb '{cmd_name}'", ", ".join(verbs), did_you_mean(cmd_name, verbs))
        return getattr(import_module(f"{__name__}.{cmd_name}"), cmd_name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Verbs"):
            formatter.write_dl([(verb, _summary(verb)) for verb in self.list_commands(ctx)])


@click.group(
    cls=_Verbs,
    subcommand_metavar="VERB [ARGS]...",
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(package_name="monochord")
def monochord() -> None:
    """Monochord: acoustic tactile sensing with a driven string."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 2 bad argument or input, 1 failed, 130 interrupted."""
    sys.exit(run(sys.argv[1:] if arguments is None else arguments))


def run(arguments: list[str]) -> int:
    """Run the command line and return its exit status, printing any error as one line on stderr."""
    try:
        return _answered(arguments)
    except (KeyboardInterrupt, click.Abort):
        return INTERRUPTED
    except SystemError as error:  # what comes of Control-C inside a compiled kernel
        if not isinstance(error.__cause__ or error.__context__, KeyboardInterrupt):
            raise
        return INTERRUPTED


def _answered(arguments: list[str]) -> int:
    """Run the command line with every error but an interruption told."""
    try:
        result = monochord.main(arguments, prog_name="monochord", standalone_mode=False)
        _flush()
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        return 2
    except BrokenPipeError:  # the reader of the output went away, as `head` does
        _forget_output()
        return 1
    except (click.ClickException, MonochordError, OSError) as error:
        line, status = _verdict(error, arguments)
        _forget_output()
        click.echo("monochord: " + " ".join(line.split()), err=True)
        return status
    except SystemExit as stop:  # click's answer to a reader that went away
        return stop.code if isinstance(stop.code, int) else 1
    return result if isinstance(result, int) else 0


def _verdict(error: click.ClickException | MonochordError | OSError, arguments: list[str]) -> tuple[str, int]:
    """Return the line and the exit status that an error ends with; a fault of ours is raised again."""
    match error:
        case click.UsageError():
            named = [word for word in arguments[:1] if not word.startswith("-")]
            verb = error.ctx.command_path if error.ctx else " ".join(["monochord", *named])
            return f"{error.format_message()} (see '{verb} --help')", 2
        case InputError() | DeviceError():
            return str(error), 2
        case OSError() if error.errno in _NOT_WRITTEN:
            what = error.filename or "output"
            return str(InputError(f"{what} ({error.strerror})", "a place that takes all of it", _ROOM)), 2
        case OSError(filename=None):
            raise error
        case OSError():
            return f"{error.filename}: {error.strerror}", 2
        case _:
            return str(error), 1


def _flush() -> None:
    if sys.stdout:  # None where a program was started without one
        sys.stdout.flush()


def _forget_output() -> None:
    """Let go of standard output that cannot be written, or Python complains of it again as it ends."""
    try:
        _flush()
    except OSError:
        with suppress(OSError):
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, sys.stdout.fileno())
            os.close(null)


def _summary(verb: str) -> str:
    """First line of a verb's docstring, read from its text: help must not import what the verbs need."""
    spec = find_spec(f"{__name__}.{verb}")
    if spec is None or spec.origin is None:
        return ""
    for node in ast.parse(Path(spec.origin).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef) and node.name == verb:
            return (ast.get_docstring(node) or "").partition("\n")[0]
    return ""
