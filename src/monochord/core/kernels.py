"""Compiles Monochord's kernels with numba and caches them on disk beside their modules.

A cache file may be empty, truncated or corrupted after a full disk, a power failure or a bit error; numba
would raise an unexpected error, or run it. Here each file ends with a checksum of its content. A file without
a valid checksum counts as missing: the kernel is compiled again and the file replaced. If the cache cannot be
written, kernels are still compiled. A kernel is also compiled again when its file changes, or another file
whose compiled functions its file imports by name.

In a terminal, compilation shows a progress bar in any program (`monochord.core.compilation`). Python's
garbage collector is paused meanwhile: most objects of a compilation are kept, and collection takes a tenth of
its time.
"""

import gc
import hashlib
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from typing import Any, TypeVar

from numba import njit
from numba.core import event
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.ccallback import CFunc
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature
from numba.core.targetconfig import ConfigStack

from monochord.core.compilation import CompilationBar

Function = TypeVar("Function", bound=Callable[..., Any])

COMPILE: Any = njit
"""numba's type stubs lack some of its options, and do not preserve a function's signature."""
DIGEST_SIZE = hashlib.sha256().digest_size


def compile_lazily(function: Any, **options: Any) -> Any:
    """Return a function that numba compiles at its first call, without a cache; takes `numba.njit` options.

    >>> compile_lazily(lambda x: x + 1.0)(2.0)
    3.0
    """
    return COMPILE(error_model="numpy", no_cfunc_wrapper=True, pipeline_class=_Compiler, **options)(function)


def kernel(signature: str = "", **options: Any) -> Callable[[Function], Function]:
    """Compile a function at its first call, or at once for a `signature`, and cache it on disk.

    Division follows NumPy: division by zero gives infinity without an error. With ``NUMBA_DISABLE_JIT`` set,
    the function is not compiled. A signature states the types of result and arguments, such as
    ``"int64(int64[::1], intp)"``; `options` are those of `numba.njit`, such as ``fastmath``.

    >>> @kernel()
    ... def ratio(one: float, other: float) -> float:
    ...     return one / other
    >>> ratio(1.0, 0.0)
    inf
    """

    def compiled(function: Function) -> Function:
        dispatcher = compile_lazily(function, **options)
        if hasattr(dispatcher, "py_func"):
            # Without a cache: a function in no file, one that calls such, and where none can be written.
            with suppress(RuntimeError, OSError):
                dispatcher._cache = _Cache(function)  # noqa: SLF001
            if signature:
                dispatcher.compile(signature)
                dispatcher.disable_compile()
        return dispatcher

    return compiled


def part(**options: Any) -> Callable[[Function], Function]:
    """Compile a function that kernels call; it is cached as part of them.

    A kernel in another file imports it by name, so that the kernel's cache depends on both files. Python has
    no entry to the compiled code, which would take as long to compile as a short function. A call from Python
    runs the uncompiled function. `options` are those of `numba.njit`.

    >>> @part()
    ... def half(number: float) -> float:
    ...     return number / 2.0
    >>> half(1.0)
    0.5
    """

    def compiled(function: Function) -> Function:
        dispatcher = compile_lazily(function, no_cpython_wrapper=True, **options)
        if hasattr(dispatcher, "py_func"):
            dispatcher.__class__ = _Part
        return dispatcher

    return compiled


def callback(signature: Any) -> Callable[[Any], Any]:
    """Compile a function at once into a C function, and cache it; `address` is its address."""

    def compiled(function: Any) -> Any:
        compiled_function: Any = CFunc(function, normalize_signature(signature), locals={}, options={})
        with suppress(RuntimeError):
            compiled_function._cache = _Cache(function)  # noqa: SLF001
        compiled_function.compile()
        return compiled_function

    return compiled


class _Compiler(Compiler):
    """Shares numba's internal compilations, such as ``np.zeros``, between all functions.

    numba would compile these again for every different option of the caller, even one that only selects the
    caller's entries. They see the entries of a function of numba's here.
    """

    def define_pipelines(self) -> Any:
        """Return the usual steps."""
        seen: Any = ConfigStack().top()  # a copy: the options of this function itself stay
        seen.no_cpython_wrapper, seen.no_cfunc_wrapper = True, False
        return super().define_pipelines()


class _Part(CPUDispatcher):
    """A function that is compiled for kernels; without a way into its code, numba's own call would crash."""

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Run the function uncompiled."""
        return self.py_func(*arguments, **named)


class _Cache(FunctionCache):
    """A function's cache on disk, with checked files."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = _Files(
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=(self._impl.locator.get_source_stamp(), _checksum_of_calls(function)),
        )

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save the compiled code, where possible."""
        with suppress(OSError):
            super().save_overload(sig, data)


def _checksum_of_calls(function: Any) -> str:
    """Return a checksum of the other files with compiled functions that a function may call.

    They are the files of those that its module has imported by name, and of those that these call in turn.
    """
    files, waiting = {function.__code__.co_filename: b""}, [function]
    while waiting:
        for value in waiting.pop().__globals__.values():
            called = value.py_func if isinstance(value, CPUDispatcher) else function
            file = called.__code__.co_filename
            if file not in files:
                files[file] = Path(file).read_bytes()
                waiting.append(called)
    return hashlib.sha256(b"".join(files.values())).hexdigest()


class _Files(IndexDataCacheFile):
    """The index and compiled code of a function; damaged files count as missing."""

    def _load_index(self) -> Any:
        if not _is_whole(Path(self._index_path)):
            return {}
        try:
            return super()._load_index()
        except (
            AttributeError,
            ImportError,
        ):  # a class of the former version, after an upgrade
            return {}

    def _load_data(self, name: str) -> Any:
        path = Path(self._data_path(name))
        if not _is_whole(path):
            raise FileNotFoundError(path)
        return super()._load_data(name)

    @contextmanager
    def _open_for_write(self, filepath: str) -> Generator[Any]:
        content = BytesIO()
        yield content
        with super()._open_for_write(filepath) as file:
            file.write(content.getvalue() + hashlib.sha256(content.getvalue()).digest())


def _is_whole(path: Path) -> bool:
    """Return whether a file exists and ends with a valid checksum of its content."""
    try:
        content = path.read_bytes()
    except OSError:
        return False
    return hashlib.sha256(content[:-DIGEST_SIZE]).digest() == content[-DIGEST_SIZE:]


class _Shown(event.Listener):
    """Passes numba's compilation events to the bar.

    They nest, since numba compiles in one thread at a time.
    """

    def __init__(self) -> None:
        self._bar = CompilationBar()

    def on_start(self, event: Any) -> None:  # noqa: ARG002
        """Record that a compilation starts, possibly nested in another."""
        self._bar.start()

    def on_end(self, event: Any) -> None:  # noqa: ARG002
        """Record that a compilation has ended."""
        self._bar.stop()


class _Uncollected(event.Listener):
    """Pauses Python's garbage collector during the outermost compilation."""

    def __init__(self) -> None:
        self._depth, self._was_on = 0, False

    def on_start(self, event: Any) -> None:  # noqa: ARG002
        """Pause the collector."""
        if self._depth == 0:
            self._was_on = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, event: Any) -> None:  # noqa: ARG002
        """Resume the collector, if it was on."""
        self._depth -= 1
        if self._depth == 0 and self._was_on:
            gc.enable()


for listener in (_Shown(), _Uncollected()):
    event.register("numba:compile", listener)
