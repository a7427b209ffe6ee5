"""``python -m hardware.cad prototype --out parts``: STEP, STL, pictures and checks of a sensor's parts."""

import argparse
import importlib.util
import sys
from pathlib import Path

from hardware.cad.ebow import refuse_ebows_that_do_not_fit
from hardware.cad.parameters import UNMEASURED, Hardware, load_hardware
from hardware.cad.physics import physics
from monochord.core.errors import InputError, MissingLibraryError, MonochordError

NEEDED = ("build123d", "trimesh")


def main(arguments: list[str] | None = None) -> int:
    """Build the parts of each sensor named, or print the figures behind them; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m hardware.cad", description=__doc__)
    parser.add_argument("sensor", nargs="+", help="a sensor preset, or a sensor's TOML file")
    parser.add_argument(
        "--out", type=Path, default=Path("parts"), help="folder, one below it for each sensor"
    )
    parser.add_argument("--driver", choices=("coil", "ebow"), default="coil", help="wound coils or EBows")
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=MM", help="set a dimension, in mm"
    )
    parser.add_argument("--physics", action="store_true", help="print the figures only; needs no CAD library")
    parser.add_argument("--no-pictures", action="store_true", help="leave out the pictures")
    options = parser.parse_args(arguments)
    try:
        given = dict(_dimension(each) for each in options.set)
        sensors = [load_hardware(each, options.driver, **given) for each in options.sensor]
        if options.driver == "ebow" and not options.physics:
            for each in sensors:
                refuse_ebows_that_do_not_fit(each)
        return _print_physics(sensors) if options.physics else _build(sensors, options.out, given, options)
    except MonochordError as error:
        print(error, file=sys.stderr)
        return 2


def _dimension(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise InputError(f"--set {text}", "NAME=MM, such as piezo_diameter=27") from None


def _print_physics(sensors: list[Hardware]) -> int:
    for hardware in sensors:
        print(f"# {hardware.sensor.name}")
        for name, value in physics(hardware).items():
            print(f"{name:48s} {value:10.4g}")
    return 0


def _build(sensors: list[Hardware], out: Path, given: dict[str, float], options: argparse.Namespace) -> int:
    missing = [each for each in NEEDED if importlib.util.find_spec(each) is None]
    if missing:
        raise MissingLibraryError("CAD", " and ".join(missing), "cad")
    from hardware.cad.build import build  # noqa: PLC0415 - a gigabyte that --physics does without

    failed = 0
    for hardware in sensors:
        name = Path(hardware.sensor.name).stem
        report = build(hardware, out / name, pictures=not options.no_pictures)
        failed += not report.good
        closed = sum(each.good for each in report.meshes)
        kept = sum(each.kept for each in report.clearances)
        print(
            f"{name}: {closed} of {len(report.meshes)} meshes closed and right, "
            f"{len(report.overlaps)} overlaps, {kept} of {len(report.clearances)} clearances kept, "
            f"STEP within {report.step_difference:.0e}, {report.seconds:.0f} s of CPU; {out / name}"
        )
        for line in report.faults:
            print(f"  {line}", file=sys.stderr)
    assumed = {name: value for name, value in sensors[0].assumed.items() if name not in given}
    print(
        "Not measured, assumed: " + ", ".join(f"{name} {value:g}" for name, value in assumed.items()) + " mm."
    )
    print(f"Measure these on your parts (hardware/README.md) and --set them: {len(UNMEASURED)} in all.")
    print("No person has built a sensor from these files yet.")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
