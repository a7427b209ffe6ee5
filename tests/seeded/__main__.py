"""Put faults into copies of the source, one at a time, and see whether the tests notice each.

Run it as ``python -m tests.seeded``, or with the names of faults or packages; ``nice -n 10`` before it leaves
the machine to others. The status is 0 where every fault is caught, 1 where one is missed, no longer applies
or cannot be judged.
"""

import argparse
import json
import signal
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from difflib import get_close_matches
from pathlib import Path

from tests.seeded.faults import FAULTS, Fault, read_faults
from tests.seeded.trial import CAUGHT, OUTCOMES, Verdict, trials

ROOT = Path(__file__).parents[2]


def main() -> int:
    """Run what the arguments say."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.seeded", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="faults or packages; all by default")
    parser.add_argument("--tests", nargs="+", default=[], metavar="PATH", help="instead of those named there")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the results there, too")
    parser.add_argument("--limit", type=float, default=600.0, metavar="S", help="for each run (default: 600)")
    parser.add_argument("--list", action="store_true", help="say what each fault does, and run nothing")
    parser.add_argument("--faults", type=Path, default=FAULTS, metavar="FILE", help="where they are listed")
    parser.add_argument("--root", type=Path, default=ROOT, metavar="DIR", help="the tree that is tried")
    options = parser.parse_args()
    for number in (signal.SIGINT, signal.SIGTERM):  # its copies go, too
        signal.signal(number, signal.default_int_handler)
    try:
        faults = _chosen(read_faults(options.faults), options.names)
    except ValueError as error:
        parser.error(str(error))
    absent = [path for path in options.tests if not (options.root / path.partition("::")[0]).exists()]
    if absent:
        parser.error(f"tests {absent[0]}: expected files or folders of {options.root}")
    if options.list:
        for fault in faults:
            print(f"{fault.package:<12}{fault.name:<34}{'fix' if fault.fix else '   '}  {fault.effect}")
        return 0
    verdicts = _tried(faults, options.root.resolve(), options.tests, options.limit)
    counts = Counter(verdict.outcome for verdict in verdicts.values())
    print(f"{len(faults)} faults: " + ", ".join(f"{counts[name]} {name}" for name in OUTCOMES))
    if options.json:
        rows = [{**asdict(fault), **asdict(verdicts[fault.name])} for fault in faults]
        text = json.dumps({"counts": {name: counts[name] for name in OUTCOMES}, "faults": rows}, indent=1)
        options.json.write_text(text + "\n", encoding="utf-8")
    return int(counts[CAUGHT] < len(faults))


def _chosen(faults: Mapping[str, Fault], names: Sequence[str]) -> list[Fault]:
    """Return the faults that names, of faults or packages, stand for; all for none."""
    packages = {fault.package for fault in faults.values()}
    for name in names:
        if name not in faults and name not in packages:
            near = get_close_matches(name, [*faults, *packages], n=3) or sorted(packages)
            raise ValueError(f"fault '{name}': expected a fault or a package, such as {', '.join(near)}")
    return [each for each in faults.values() if not names or {each.name, each.package} & {*names}]


def _tried(faults: Sequence[Fault], root: Path, tests: Sequence[str], limit: float) -> dict[str, Verdict]:
    """Return what came of each fault by its name, printed as it comes."""
    print(f"{'package':<12}{'fault':<34}{'fix':<5}{'result':<15}{'s':>6}  by", flush=True)
    verdicts: dict[str, Verdict] = {}
    with trials(root, limit) as trial:
        for fault in faults:
            verdicts[fault.name] = verdict = trial.verdict(fault, tests)
            print(f"{fault.package:<12}{fault.name:<34}{'yes' if fault.fix else '-':<5}{verdict.outcome:<15}"
                  f"{verdict.seconds:>6.0f}  {verdict.by}", flush=True)  # fmt: skip
    return verdicts


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit("interrupted")
