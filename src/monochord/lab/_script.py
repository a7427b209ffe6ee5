"""The file that a simulated device plays when it runs as a process: arrays and settings."""

import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from monochord.core.config import from_tree
from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats
from monochord.core.units import Seconds

T = TypeVar("T")


def write_script(path: Path, arrays: Mapping[str, Floats | Audio], settings: Any) -> None:
    """Write arrays and a dataclass of settings; `read_script` reads them."""
    np.savez(path, allow_pickle=False, settings=json.dumps(asdict(settings)), **arrays)


def read_script(path: Path, kind: type[T]) -> tuple[dict[str, Floats], T]:
    """Return the arrays by name, and the settings; raises `InputError` for an invalid file."""
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: np.asarray(file[name], np.float64) for name in file if name != "settings"}
            tree = {
                name: value for name, value in json.loads(str(file["settings"])).items() if value is not None
            }
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path} ({error})", "a file from write_script") from error
    return arrays, from_tree(kind, tree)


def follow_input(address: Mapping[str, Any], begin_at: Callable[[Seconds], None]) -> None:
    """Print an address as a line of JSON, then read start times from the input, one a line, until it ends."""
    print(json.dumps(address), flush=True)  # noqa: T201  (read by the parent process)
    try:
        for line in sys.stdin:
            begin_at(float(line))
    except KeyboardInterrupt:
        return
