"""A model behind a real JACK server says what it says of the same sound in a file."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from studies.model_speed import drawn

from monochord.cli import run
from monochord.core.types import Estimate, Signal, Window
from monochord.perception.estimators.model import ModelEstimator
from monochord.physics.sensors import load_sensor

pytestmark = pytest.mark.jack
RATE, SIZE = 44100, 4410
SIGNAL = Signal(sample_rate=RATE, channels=2, string=load_sensor("prototype").string)


@pytest.mark.parametrize("hop", ["0.05", pytest.param("0.001", marks=pytest.mark.slow)])
def test_it_says_over_jack_what_it_says_of_the_file(
    jack_server: Any, play: Any, recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], hop: str
) -> None:
    drawn("fft_harmonic", SIGNAL, SIZE).save(tmp_path / "run")
    play(recording)
    source = ["player:", "--source", "jack", "--set", f"source.server={jack_server.name}"]
    options = ["--hop", hop, "--json", "--seconds", "1.4"]
    assert run(["live", str(tmp_path / "run"), *source, *options]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert len(lines) > 3  # a busy machine skips windows
    # A busy machine skips windows, or a short hop does; of the file the same ones are read.
    sound = soundfile.read(recording, always_2d=True)[0].T.astype(np.float32)
    estimate = ModelEstimator(path=tmp_path / "run").prepare(Signal(sample_rate=RATE, channels=2), SIZE)
    for line in lines:
        start = round(line["time"] * RATE)
        of_file = estimate(Window(samples=sound[:, start : start + SIZE], start=start, sample_rate=RATE))
        assert of_file.keys() == {"contact", "slip", "position", "force"}
        said = {name: (line[name], line[f"{name}_std"]) for name in of_file}
        assert said == {name: _numbers(each) for name, each in of_file.items()}
        assert (line["valid"], line["why_not"]) == (of_file["position"].valid, of_file["position"].reason)


def _numbers(estimate: Estimate) -> tuple[float | None, ...]:
    """Return value and standard error as a line of jsonl has them."""
    return tuple(number if math.isfinite(number) else None for number in (estimate.value, estimate.std))
