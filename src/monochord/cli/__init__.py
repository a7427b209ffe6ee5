"""The command line: one module per command, found by name; it only parses arguments and prints.

Another distribution adds commands by entry points of the group ``monochord.commands``: the entry's name is
the command's, its value the module and the click command in it, ``my_lab.command:lamp``. Such a command
prints with `echo`.

A command exits with status 0 only if its work was done, and with status 2 and one line on stderr for a bad
argument or input. Control-C, SIGTERM or SIGHUP end it with one line and status 130; commands that run until
stopped instead print their summary and exit with status 0. Importing this module and asking for help are
fast: a command's module loads when the command is used.
"""

import ast
import errno
import gc
import os
import signal
import sys
import threading
from _thread import interrupt_main
from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib import import_module
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path
from pkgutil import iter_modules
from types import FrameType
from typing import Any, NoReturn

import click
from click.shell_completion import CompletionItem

from monochord.cli._moved import refuse_moved
from monochord.cli._output import echo
from monochord.core.errors import DeviceError, InputError, MonochordError, did_you_mean

__all__ = ["echo", "main", "run"]

INTERRUPTED = 130
"""Exit status of an interrupted command."""
GROUPS: Mapping[str, tuple[str, ...]] = {
    "Try it": ("demo", "simulate", "design"),
    "Use a sensor": ("tune", "identify", "live", "locate", "calibrate", "skin"),
    "Record and collect": ("record", "collect", "sessions"),
    "Train and test": ("build", "audit", "train", "evaluate", "publish"),
    "Look and check": ("list", "doctor", "figure", "bench"),
}
"""Command groups in the help; a command in no group comes last."""
UNGROUPED = "More commands"
ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
RERAISE_AFTER = 0.02
"""Delay before an interruption lost in a callback is raised again, in s."""
_LINE = "monochord: interrupted"
_REMEDY_FULL = "free space there, or write elsewhere"
_NOT_WRITTEN = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


class _Commands(click.Group):
    """The commands of this folder, each module with one command of its name, and those of packages."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        return sorted({*_built_in_names(), *_added()})

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name in _built_in_names():  # without a look at what is installed, which takes time
            return getattr(import_module(f"{__name__}.{cmd_name}"), cmd_name)
        names = self.list_commands(ctx)
        refuse_moved("command", cmd_name, names)
        if cmd_name not in names:
            raise InputError(f"command '{cmd_name}'", ", ".join(names), did_you_mean(cmd_name, names))
        return _added_command(cmd_name)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        names = [name for name in self.list_commands(ctx) if name.startswith(incomplete)]
        options = [] if names else click.Command.shell_complete(self, ctx, incomplete)
        return [CompletionItem(name, help=_summary(name)) for name in names] + options

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as error:  # for which click would print an empty line
            raise click.Abort from error

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        names = self.list_commands(ctx)
        grouped = {name for group in GROUPS.values() for name in group}
        groups = {**GROUPS, UNGROUPED: tuple(name for name in names if name not in grouped)}
        width = max(map(len, names))
        for title, members in groups.items():
            rows = [(name.ljust(width), _summary(name)) for name in members if name in names]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)


@click.group(
    cls=_Commands,
    subcommand_metavar="COMMAND [ARGS]...",
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(package_name="monochord")
@click.pass_obj
def monochord(begin: Callable[[], None] | None) -> None:
    """Monochord: acoustic tactile sensing with a driven string.

    Try 'monochord demo' first. 'monochord COMMAND --help' explains a command with examples.

    \b
    monochord demo
    monochord live demo --source twin
    """  # noqa: D301
    if begin:  # the command's file is loaded, and its work comes next
        begin()


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 2 bad argument or input, 1 failed, 130 interrupted."""
    _take_signals(_end_at_once)  # while there is only loading to be cut off
    sys.unraisablehook = _unraisable
    status = run(sys.argv[1:] if arguments is None else arguments, lambda: _take_signals(_raise))
    _take_signals(_end_at_once)  # the work is over, and the interpreter takes its time to end
    if status == INTERRUPTED:  # whatever an interruption left half loaded need not be taken down
        gc.collect()  # a pool's semaphores: else multiprocessing warns that they leak
        _forget_output()
        os._exit(status)
    sys.exit(status)


def run(arguments: list[str], begin: Callable[[], None] | None = None) -> int:
    """Run the command line and return its exit status, printing any error as one line on stderr.

    `begin` is called once the command is loaded, before it runs.
    """
    try:
        return _status_of(arguments, begin)
    except BaseException as error:
        if not _is_interruption(error):
            raise
        _forget_output()
        echo(_LINE, err=True)
        return INTERRUPTED


def _is_interruption(error: BaseException | None) -> bool:
    """Return whether an error was caused by Control-C, possibly as another error from a compiled kernel."""
    seen: set[int] = set()  # causes may go round in a circle
    while error is not None and id(error) not in seen:
        if isinstance(error, (KeyboardInterrupt, click.Abort)):
            return True
        seen.add(id(error))
        error = error.__cause__ or error.__context__
    return False


def _take_signals(handler: Callable[[int, FrameType | None], NoReturn]) -> None:
    """Install a handler for the signals that request the end, unless ignored, as under `nohup`."""
    for number in ENDING_SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def _raise(number: int, frame: FrameType | None) -> NoReturn:  # noqa: ARG001
    raise KeyboardInterrupt


def _end_at_once(number: int, frame: FrameType | None) -> NoReturn:  # noqa: ARG001
    with suppress(OSError):
        os.write(2, f"{_LINE}\n".encode())
    os._exit(INTERRUPTED)


def _unraisable(lost: "sys.UnraisableHookArgs") -> None:
    """Raise an interruption again if it occurred in a callback, where Python drops exceptions."""
    if lost.exc_type is KeyboardInterrupt:
        threading.Timer(RERAISE_AFTER, interrupt_main).start()
    else:
        sys.__unraisablehook__(lost)


def _status_of(arguments: list[str], begin: Callable[[], None] | None) -> int:
    """Run the command line, printing every error except an interruption."""
    try:
        result = monochord.main(arguments, prog_name="monochord", standalone_mode=False, obj=begin)
        _flush()
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        return 2
    except BrokenPipeError:  # the reader of the output went away, as `head` does
        _forget_output()
        return 1
    except (click.ClickException, MonochordError, OSError) as error:
        if _is_interruption(error):
            raise
        line, status = _verdict(error, arguments)
        _forget_output()
        echo("monochord: " + " ".join(line.split()), err=True)
        return status
    except SystemExit as stop:  # click's answer to a reader that went away, and after a completion
        return stop.code if isinstance(stop.code, int) else 1
    return result if isinstance(result, int) else 0


def _verdict(error: click.ClickException | MonochordError | OSError, arguments: list[str]) -> tuple[str, int]:
    """Return the line and the exit status of an error; an internal error is raised again."""
    match error:
        case click.UsageError():
            named = [word for word in arguments[:1] if not word.startswith("-")]
            command = error.ctx.command_path if error.ctx else " ".join(["monochord", *named])
            return f"{error.format_message()} (see '{command} --help')", 2
        case InputError() | DeviceError():
            return str(error), 2
        case OSError() if error.errno in _NOT_WRITTEN:
            given = f"{error.filename or 'output'} ({error.strerror})"
            return str(InputError(given, "a disk with enough free space", _REMEDY_FULL)), 2
        case FileNotFoundError(filename=None):  # os.getcwd() had nothing to return
            return str(InputError("a working directory that was removed", "an existing one", "cd to one")), 2
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
    """Detach a standard output that cannot be written, or Python reports it again at exit."""
    try:
        _flush()
    except OSError:
        with suppress(OSError):
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, sys.stdout.fileno())
            os.close(null)


def _built_in_names() -> set[str]:
    return {module.name for module in iter_modules(__path__) if not module.name.startswith("_")}


def _added() -> Mapping[str, tuple[EntryPoint, ...]]:
    """Return what installed packages add, by name."""
    from monochord.core.registry import installed  # noqa: PLC0415  (few command lines need it)

    return installed("commands")


def _added_command(name: str) -> click.Command:
    """Return a command of an installed package; raises `InputError` where it is none, or one of two."""
    from monochord.core.registry import load_added, refuse_clash  # noqa: PLC0415

    def command_of(value: Any) -> click.Command:
        if not isinstance(value, click.Command):
            raise TypeError(f"{entry.value} is no command of click")
        return value

    refuse_clash("command", name, _added()[name], built_in=False)
    (entry,) = _added()[name]
    return load_added("command", entry, "a command that can be imported", command_of)


def _summary(command: str) -> str:
    """Return the first line of a command's docstring from its text: help must import no heavy module."""
    module, function = f"{__name__}.{command}", command
    if command not in _built_in_names():
        entry = _added()[command][0]
        module, function = entry.module, entry.attr
    try:
        spec = find_spec(module)
    except Exception:  # noqa: BLE001  (a package runs its code; the command itself says what is wrong)
        spec = None
    if spec is None or spec.origin is None:
        return ""
    for node in ast.parse(Path(spec.origin).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef) and node.name == function:
            return (ast.get_docstring(node) or "").partition("\n")[0]
    return ""
