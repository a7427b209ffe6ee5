"""Names of earlier versions that are now studies, or in packages, of the repository."""

from collections.abc import Iterable, Mapping

from monochord.core.errors import InputError, MissingLibraryError

MOVED: Mapping[str, Mapping[str, str]] = {
    "benchmark": {"model": "model_speed", "sinks": "sink_delay", "strings": "strings_speed"},
    "figure": {
        "convergence": "convergence",
        "modes": "modes",
        "paper_tables": "paper_tables",
        "touch": "touch",
        "trends": "trends",
    },
}
"""The study that replaces each name, by kind of name."""
PACKAGES: Mapping[str, str] = {"weights": "monochord-encoders"}
"""The package that has each command."""


def refuse_moved(kind: str, name: str | None, known: Iterable[str]) -> None:
    """Raise `InputError` for a name that is now a study, or in a package that is not installed."""
    study = MOVED.get(kind, {}).get(name or "")
    if study:
        remedy = f"it is a study now: python -m studies.{study}, in the repository"
        raise InputError(f"{kind} '{name}'", ", ".join(known), remedy)
    package = PACKAGES.get(name or "") if kind == "command" else None
    if package and name not in set(known):
        raise MissingLibraryError(f"The command '{name}'", f"the package {package}", package)
