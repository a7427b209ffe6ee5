"""The errors that users see: one line with what was given, what was expected, and what to do."""

from collections.abc import Generator, Iterable
from contextlib import contextmanager
from difflib import get_close_matches

from monochord.core.installing import installation

LONGEST_GIVEN = 1000
"""Most characters of the given value quoted in an error; a file may hold a value of any length."""
SIMILAR = 0.6
"""Least likeness of a misspelt name, of 1: twice the letters in common over those of both."""


class MonochordError(Exception):
    """Base class of every error that Monochord raises intentionally.

    Examples
    --------
    >>> import monochord as mc
    >>> try:
    ...     mc.load_sensor("prototpye")
    ... except mc.MonochordError as error:
    ...     print(error)
    sensor 'prototpye': expected ...prototype...; did you mean 'prototype'?
    """


class InputError(MonochordError, ValueError):
    """An unusable input; the command line prints it as one line and exits with status 2.

    Parameters
    ----------
    given
        The given value, as a noun phrase: ``"force -1.0 N"``. All three are also attributes.
    expected
        The expected value: ``"0 to 2 N"``.
    remedy
        What to do, in the imperative; optional.

    >>> error = InputError("force -1 N", "0 N or more", "press, don't pull")
    >>> str(error)
    "force -1 N: expected 0 N or more; press, don't pull"
    >>> error.given, error.expected, error.remedy
    ('force -1 N', '0 N or more', "press, don't pull")
    """

    def __init__(self, given: str, expected: str, remedy: str = "") -> None:
        given, expected, remedy = map(_text, (given, expected, remedy))
        self.given, self.expected, self.remedy = given, expected, remedy
        line = f"{_shortened(given)}: expected {expected}" + (f"; {remedy}" if remedy else "")
        super().__init__(" ".join(line.split()))

    @property
    def allowed(self) -> str:
        """Alias of `expected`."""
        return self.expected

    def __reduce__(self) -> tuple[type["InputError"], tuple[str, str, str]]:
        # Without it an error raised in a worker process cannot come home: pickle hands over one argument.
        return type(self), (self.given, self.expected, self.remedy)


class MissingLibraryError(InputError):
    """A missing library, required by an optional part of Monochord.

    Parameters
    ----------
    task
        The task that requires it: ``"Training"``.
    library
        Name and version: ``"torch >= 2.6"``.
    extra
        The Monochord extra that installs it, ``"train"``, or else its name on the package index.

    >>> str(MissingLibraryError("Exporting parquet", "pyarrow >= 17", "export"))
    "Exporting parquet requires pyarrow >= 17. Install it: ...python... -m pip install 'pyarrow>=17'"
    """

    def __init__(self, task: str, library: str, extra: str) -> None:
        task, library, extra = map(_text, (task, library, extra))
        command = installation(extra)
        super().__init__(f"{task} without {library}", library, command)
        self.args = (f"{task} requires {library}. Install it: {command}",)
        self._task, self._library, self._extra = task, library, extra

    def __reduce__(self) -> tuple[type["MissingLibraryError"], tuple[str, str, str]]:
        return type(self), (self._task, self._library, self._extra)


@contextmanager
def required(task: str, library: str, extra: str) -> Generator[None]:
    """Raise `MissingLibraryError` where an import inside the context fails."""
    try:
        yield
    except ImportError as error:
        raise MissingLibraryError(task, library, extra) from error


class DeviceError(MonochordError, RuntimeError):
    """A missing or lost device or server.

    Examples
    --------
    >>> import monochord as mc
    >>> try:
    ...     next(mc.listen("jack", server="no_such_server"))
    ... except mc.DeviceError as error:
    ...     print(type(error).__name__)
    DeviceError
    """


def _text(words: object) -> str:
    """Return words for an error, whatever a caller passes, in UTF-8."""
    try:
        return str(words).encode(errors="backslashreplace").decode()
    except Exception:  # noqa: BLE001  (an object's own, or an integer of too many digits)
        return f"a {type(words).__name__}"


def _shortened(given: str) -> str:
    if len(given) <= LONGEST_GIVEN:
        return given
    return f"{given[: LONGEST_GIVEN - 200]} ... {given[-200:]}"


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """Return ``did you mean 'x'?`` for the closest of `choices`, or an empty string.

    >>> did_you_mean("sorce", ["source", "sink"])
    "did you mean 'source'?"
    """
    meant = closest(word, choices)
    return "" if meant is None else f"did you mean '{meant}'?"


def closest(word: str, choices: Iterable[str], likeness: float = SIMILAR) -> str | None:
    """Return the one of `choices` that a word is meant for, in whatever case; None if it is like none.

    `likeness` is the least that counts, as `SIMILAR`, of 1.

    >>> closest("Sorce", ["source", "sink"]), closest("s" * 10**6, ["source"])
    ('source', None)
    """
    known = {choice.lower(): choice for choice in choices}
    if len(word) > (2.0 / likeness - 1.0) * max(map(len, known), default=0):  # too long, whatever is in it
        return None
    close = get_close_matches(word.lower(), known, n=1, cutoff=likeness)
    return known[close[0]] if close else None
