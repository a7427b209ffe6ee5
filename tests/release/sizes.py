"""How large the core installation is, by package, and whether it has grown."""

import json
from collections.abc import Mapping
from importlib.metadata import distributions
from pathlib import Path

RECORDED = Path(__file__).with_name("sizes.json")
GROWTH, SMALL = 1.1, 1.0
"""Growth of a package by its newer version, as a ratio and in MB, that needs no decision."""
TOOLS = {"pip", "setuptools", "wheel"}


def sizes(site: Path) -> dict[str, float]:
    """Return the MB of each package that is installed in a folder, without compiled bytecode."""
    found: dict[str, float] = {}
    for package in distributions(path=[str(site)]):
        files = {
            Path(str(package.locate_file(file))) for file in package.files or () if file.suffix != ".pyc"
        }
        size = sum(file.stat().st_size for file in files if file.is_file())
        if package.name.lower() not in TOOLS:
            found[package.name.lower().replace("_", "-")] = round(size / 1e6, 2)
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def recorded() -> dict[str, float]:
    """Return the sizes that were recorded last."""
    return json.loads(RECORDED.read_text(encoding="utf-8"))


def grown(now: Mapping[str, float], then: Mapping[str, float]) -> list[str]:
    """Return a line for each package that is new or has grown by more than a new version accounts for.

    >>> grown({"numpy": 60.0, "torch": 600.0}, {"numpy": 40.0, "scipy": 80.0})
    ['numpy: 60.0 MB instead of 40.0', 'torch: 600.0 MB, new']
    """
    lines: list[str] = []
    for name, size in now.items():
        if name not in then:
            lines.append(f"{name}: {size:.1f} MB, new")
        elif size > max(GROWTH * then[name], then[name] + SMALL):
            lines.append(f"{name}: {size:.1f} MB instead of {then[name]:.1f}")
    return lines


def table(now: Mapping[str, float], then: Mapping[str, float]) -> str:
    """Return the sizes as a table, beside those recorded."""
    rows = [f"{'package':<24}{'MB':>8}{'recorded':>10}"]
    for name in [*now, *sorted(then.keys() - now.keys())]:
        size, before = (f"{sizes[name]:.2f}" if name in sizes else "-" for sizes in (now, then))
        rows.append(f"{name:<24}{size:>8}{before:>10}")
    rows.append(f"{'total':<24}{sum(now.values()):>8.1f}{sum(then.values()):>10.1f}")
    return "\n".join(rows)
