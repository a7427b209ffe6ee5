"""A short real use of an installed Monochord, by the Python that it is installed for, in an empty folder.

With the argument ``locate`` it ends there, without the bundled model and the demonstration.
"""

import json
import subprocess
import sys
from pathlib import Path

import monochord as mc

PROGRAM = str(Path(sys.executable).with_name("monochord"))


def monochord(*arguments: str) -> str:
    return subprocess.run([PROGRAM, *arguments], check=True, stdout=subprocess.PIPE, text=True).stdout


def main() -> None:
    assert Path(mc.__file__).is_relative_to(sys.prefix), f"{mc.__file__} is not of this environment"
    assert mc.__version__ in monochord("--version")

    monochord("simulate", "appendix", "--at", "0.2275", "--seconds", "0.5", "--out", "touch.wav")
    lines = map(json.loads, monochord("locate", "touch.wav", "--string", "appendix", "--json").splitlines())
    places = [line["position"] for line in lines if line["valid"]]
    assert places
    assert all(abs(place - 0.2275) < 2e-3 for place in places), places
    if sys.argv[1:] == ["locate"]:
        return print(f"Python {sys.version.split()[0]}: touch located at {1e3 * places[-1]:.1f} mm")

    twin = mc.VirtualSensor("prototype", seed=1)
    twin.press(0.08, 1.0)
    sound, _ = twin.advance(1.0)
    table = mc.load("demo").predict(sound, sample_rate=44100)
    place = sorted(table.position.value[50:])[20]
    assert abs(place - 0.08) < 1e-3, place

    score = json.loads(monochord("demo", "--seconds", "3", "--json"))
    assert score["windows"] > 0, score
    return print(f"Python {sys.version.split()[0]}: touch located at {1e3 * place:.1f} mm, demonstration run")


if __name__ == "__main__":
    main()
