"""Feed every reader and parser with damaged and made-up input: ``python -m tests.fuzz``.

Each target runs for some seconds in a process of its own, with at most 1 GB of memory and 10 s for a case.
A traceback, a hang, a memory bomb or a process that died is made smaller and kept in a folder of findings;
the status is then 1.
"""

import argparse
import hashlib
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.fuzz.base import TARGETS, lay_out, load_target, pack, target_names, unpack
from tests.fuzz.driver import Findings, fuzz, seeds_of, shrunk
from tests.fuzz.worker import attempt


def main() -> int:
    """Run what the arguments say."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help="which; all by default")
    parser.add_argument("--seconds", type=float, default=60.0, help="for each target (default: 60)")
    parser.add_argument("--seed", type=int, default=0, help="of all that is drawn (default: 0)")
    parser.add_argument("--out", type=Path, default=Path("build/fuzz"), help="where findings go")
    parser.add_argument("--folder", type=Path, default=TARGETS, help="where the targets are")
    parser.add_argument(
        "--repeat", type=Path, metavar="FILE", help="run one kept input of the target, in the open"
    )
    options = parser.parse_args()
    names = target_names(options.folder)
    strange = set(options.targets) - set(names)
    if strange:
        parser.error(f"target {', '.join(sorted(strange))}: expected {', '.join(names)}")
    if options.repeat:
        return _repeat(options.folder, options.targets[0], options.repeat)
    failed = False
    print(f"{'target':<16}{'cases':>8}{'accepted':>9}{'refused':>9}{'traceback':>10}{'hang':>6}"
          f"{'memory':>7}{'died':>5}{'places':>7}{'peak MB':>9}{'slowest s':>10}", flush=True)  # fmt: skip
    for name in options.targets or names:
        seeds = seeds_of(options.folder, name)
        findings = fuzz(options.folder, name, seeds, seconds=options.seconds, seed=options.seed)
        count = findings.counts
        print(f"{name:<16}{findings.cases:>8}{count['accepted']:>9}{count['refused']:>9}{count['traceback']:>10}"
              f"{count['hang']:>6}{count['memory']:>7}{count['died']:>5}{len(findings.failures):>7}"
              f"{findings.peak / 1e6:>9.0f}{findings.slowest:>10.2f}", flush=True)  # fmt: skip
        _keep(options.folder, name, findings, options.out)
        failed = failed or bool(findings.failures)
    return int(failed)


def _keep(folder: Path, name: str, findings: Findings, out: Path) -> None:
    """Keep an input for each place that failed, smaller where that is possible, and say how to repeat it."""
    for place, failure in findings.failures.items():
        given = shrunk(folder, name, failure.given, place) if failure.kind != "hang" else failure.given
        file, content = pack(hashlib.sha256(f"{failure.kind} {place}".encode()).hexdigest()[:10], given)
        (out / name).mkdir(parents=True, exist_ok=True)
        (out / name / file).write_bytes(content)
        (out / name / f"{file}.txt").write_text(
            f"{failure.kind}: {place}\n\n{failure.text}\n", errors="replace"
        )
        print(f"  {failure.count} x {failure.kind}: {place}", flush=True)
        print(f"    python -m tests.fuzz {name} --repeat {out / name / file}", flush=True)


def _repeat(folder: Path, name: str, file: Path) -> int:
    with TemporaryDirectory() as place:
        lay_out(unpack(file), Path(place))
        verdict = attempt(load_target(folder, name), Path(place))
    print(f"{verdict.kind} in {verdict.seconds:.2f} s, peak {verdict.peak / 1e6:.0f} MB: {verdict.place}")
    print(verdict.text)
    return int(verdict.failed)


if __name__ == "__main__":
    sys.exit(main())
