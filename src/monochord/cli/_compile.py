"""Compiles the kernels in advance: ``python -m monochord.cli._compile``.

A kernel is compiled at its first call and cached on disk, so that a user's first command takes half a minute
longer. This module makes the first calls after an installation.
"""

import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from monochord.core.errors import InputError, MonochordError


def compile_kernels(parts: Sequence[str] = ("twin", "estimators")) -> None:
    """Compile `parts` of `PARTS`, each in a separate process; raises `MonochordError` if one fails.

    Both default parts take about equally long. The first one shows its bar in a terminal.
    """
    command = [sys.executable, "-m", "monochord.cli._compile"]
    running = [
        subprocess.Popen(  # noqa: S603  (our own module)  # nosec B603
            [*command, part],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE if number else None,
            text=True,
        )
        for number, part in enumerate(parts)
    ]
    errors = [process.communicate()[1] or "" for process in running]
    for part, process, error in zip(parts, running, errors, strict=True):
        if process.returncode:
            last = (error.strip() or "see above").splitlines()[-1]
            raise MonochordError(f"the kernels of the {part} could not be compiled: {last}")


def _twin() -> None:
    """Run the twin in both worlds."""
    from monochord.physics.twin.virtual_sensor import VirtualSensor  # noqa: PLC0415

    for world in ("plausible", "ideal"):
        VirtualSensor("prototype", world=world).advance(0.01)


def _estimators() -> None:
    """Tune and estimate the prototype's open string, as in the demonstration; locate touches of strings."""
    import numpy as np  # noqa: PLC0415
    import soundfile  # noqa: PLC0415

    # At a rate that is resampled, by two microphones that hear every other partial in opposite phase.
    phase = 2.0 * np.pi * 1010.6 / 48000 * np.arange(72000)
    partials = np.stack([np.sin(n * phase + n) / n for n in range(1, 9)]) / 9.0
    sound = np.stack([partials.sum(axis=0), partials[::2].sum(axis=0) - partials[1::2].sum(axis=0)], axis=1)
    with TemporaryDirectory() as folder:
        names = "open.wav", "touch.wav", "sensor.toml", "open.csv"
        wav, touch, tuned, table = (str(Path(folder, name)) for name in names)
        soundfile.write(wav, sound, 48000)
        _run("tune", wav, "--sensor", "prototype", "--out", tuned)
        _run("live", "demo", wav, "--sink", f"csv={table}")
        _run("simulate", "appendix", "--at", "0.2275", "--seconds", "0.5", "--out", touch)
        _run("locate", touch, "--string", "appendix", "--json")
        _run("locate", touch, "--length", "0.65", "--open-frequency", "243.252", "--json")
    _pitch()


def _pitch() -> None:
    """Estimate the pitch of a window."""
    import numpy as np  # noqa: PLC0415

    from monochord.dsp import PitchFinder  # noqa: PLC0415

    phase = 2.0 * np.pi * 200.0 / 44100 * np.arange(4410)
    sound = np.array([sum(np.sin(n * phase + n) / n for n in range(1, 11))])
    PitchFinder(sample_rate=44100, size=4410, lowest=80.0, highest=400.0).find(sound)


PARTS: Mapping[str, Callable[[], None]] = {"twin": _twin, "estimators": _estimators, "pitch": _pitch}
"""Functions that make the first calls, by the name of the compiled part."""


def _run(*arguments: str) -> None:
    from monochord.cli import run  # noqa: PLC0415

    if run(list(arguments)) != 0:
        raise MonochordError(f"monochord {' '.join(arguments)} failed")


def main(names: Sequence[str]) -> int:
    """Compile one part in this process, or the default parts in two; return the exit status."""
    try:
        if not names:
            compile_kernels()
        for name in names:
            if name not in PARTS:
                raise InputError(f"kernels '{name}'", ", ".join(PARTS))
            PARTS[name]()
    except MonochordError as error:
        print(f"monochord: {error}", file=sys.stderr)
        return 2 if isinstance(error, InputError) else 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
