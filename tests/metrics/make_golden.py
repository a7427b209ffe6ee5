"""Writes golden.json: the metrics by their definitions, in exact fractions and pure Python, row by row.

    python tests/metrics/make_golden.py

Square roots and the error function are the only steps that round, and they round once.
"""

import json
import math
import random
from fractions import Fraction
from pathlib import Path
from typing import Any

SEED, ROWS, BINS = 20240229, 57, 7


def mean(values: list[Fraction]) -> Fraction:
    return sum(values, Fraction(0)) / len(values)


def regression(truth: list[Fraction], estimate: list[Fraction], std: list[Fraction]) -> dict[str, float]:
    off = [b - a for a, b in zip(truth, estimate, strict=True)]
    a = [value - mean(truth) for value in truth]
    b = [value - mean(estimate) for value in estimate]
    product = sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))
    squares = sum((x * x for x in a), Fraction(0)) * sum((y * y for y in b), Fraction(0))
    covered = [abs(error) <= Fraction(3, 2) * one for error, one in zip(off, std, strict=True)]
    return {
        "mean_error": float(mean(off)),
        "mean_absolute_error": float(mean([abs(error) for error in off])),
        "rms_error": math.sqrt(mean([error * error for error in off])),
        "within": float(Fraction(sum(abs(error) <= Fraction(1, 2) for error in off), len(off))),
        "pearson_r": math.copysign(math.sqrt(product * product / squares), product),
        "coverage": float(Fraction(sum(covered), len(covered))),
    }


def decisions(truth: list[int], likely: list[Fraction]) -> dict[str, Any]:
    pairs = list(zip(truth, likely, strict=True))
    counts = [[sum((a, b >= Fraction(1, 2)) == (r, c) for a, b in pairs) for c in (0, 1)] for r in (0, 1)]
    shares = [Fraction(counts[kind][kind], sum(counts[kind])) for kind in (0, 1)]
    yes, no = ([b for a, b in pairs if a == kind] for kind in (1, 0))
    order = [Fraction(1) if p > q else Fraction(1, 2) if p == q else Fraction(0) for p in yes for q in no]
    # Bin number by exact comparison; the last bin holds 1 too.
    binned = [
        [pair for pair in pairs if min(int(pair[1] * BINS), BINS - 1) == number] for number in range(BINS)
    ]
    missed = [
        Fraction(len(cell), len(pairs))
        * abs(mean([b for _, b in cell]) - mean([Fraction(a) for a, _ in cell]))
        for cell in binned
        if cell
    ]
    return {
        "confusion": counts,
        "accuracy": float(Fraction(counts[0][0] + counts[1][1], len(pairs))),
        "balanced_accuracy": float(mean(shares)),
        "area_under_curve": float(mean(order)),
        "brier_score": float(mean([(b - a) ** 2 for a, b in pairs])),
        "calibration_error": float(sum(missed, Fraction(0))),
    }


def main() -> None:
    stream = random.Random(SEED)
    # Binary fractions, so that what the file holds in decimals is exactly what was reckoned with.
    truth = [Fraction(stream.randint(-900, 900), 256) for _ in range(ROWS)]
    estimate = [value + Fraction(stream.randint(-300, 300), 256) for value in truth]
    std = [Fraction(stream.randint(1, 250), 256) for _ in range(ROWS)]
    kind = [stream.randint(0, 1) for _ in range(ROWS)]
    likely = [Fraction(min(64, max(0, stream.randint(-8, 56) + 16 * one)), 64) for one in kind]
    columns = {
        "reference": [float(value) for value in truth],
        "estimate": [float(value) for value in estimate],
        "std": [float(value) for value in std],
        "kind": kind,
        "probability": [float(value) for value in likely],
    }
    golden = {
        "limit": 0.5, "sigmas": 1.5, "bins": BINS,
        "expected": regression(truth, estimate, std) | decisions(kind, likely),
    }  # fmt: skip
    path = Path(__file__).with_name("golden.json")
    rows = ",\n  ".join(f'"{name}": {json.dumps(values)}' for name, values in columns.items())
    text = f'{{\n "rows": {{\n  {rows}\n }},\n' + json.dumps(golden, indent=1)[2:]
    path.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
