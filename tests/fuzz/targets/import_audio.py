"""`sessions import` of a user's own audio and labels."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import soundfile
from tests.fuzz.base import Input, Target, given_file, taken_from
from tests.fuzz.targets._imports import brought_in

TABLES = (
    "time,contact,position,force,slip\n0.0,0,,,\n0.01,1,0.12,1.5,0\n0.02,1,0.12,1.5,1\n",
    "time;contact;own\n0,1;3\n",
    "\ufefftime\tforce\n0.0\t1.0\n0.05\t\n",
)


class Fuzz(Target):
    """A WAV or FLAC file with a table of labels."""

    def seeds(self, folder: Path) -> Iterator[Input]:
        sound = np.round(np.random.default_rng(0).uniform(-0.5, 0.5, (1600, 2)), 2)
        for number, kind in enumerate(("FLOAT", "PCM_16", "PCM_24")):
            file = folder / "take.wav"
            soundfile.write(file, sound[:, : 1 + number % 2], 16000, subtype=kind)
            (folder / "take.csv").write_text(TABLES[number], encoding="utf-8")
            yield taken_from(folder)
        soundfile.write(folder / "take.wav", sound, 16000, format="FLAC")
        yield taken_from(folder)

    def run(self, folder: Path) -> None:
        out, sound = folder.with_name("imported.mcap"), given_file(folder, "take.wav")
        out.unlink(missing_ok=True)
        table = [folder / "take.csv"] if (folder / "take.csv").exists() else []
        brought_in(out, sound, *table)
        out.unlink()
