"""Writes a model or a dataset as a folder for the Hugging Face Hub, like ``monochord publish``."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from shutil import copyfile
from typing import Any

from monochord.core.config import load_json
from monochord.core.errors import InputError
from monochord.core.ownership import part_folder
from monochord.core.ranges import checked
from monochord.datasets.split import SPLIT_FILE, Split
from monochord.datasets.store import FILE, open_dataset
from monochord.perception.model import folder_of, load
from monochord.perception.model.saving import TEXT, WEIGHTS
from monochord.perception.model.summary import facts

CARD, SUMS = "README.md", "SHA256SUMS"
METRICS, SCORES = "metrics.json", "scores.json"
MODEL_FILES = (TEXT, WEIGHTS, "SOURCES.md")
LARGEST: Mapping[int, str] = {
    1_000: "n<1K",
    10_000: "1K<n<10K",
    100_000: "10K<n<100K",
    1_000_000: "100K<n<1M",
    10_000_000: "1M<n<10M",
}
"""The Hub's names for the size of a dataset, by the number of windows that it stays below."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishedFolder:
    """A folder ready to upload: its path, and its files by name with their SHA-256."""

    path: Path
    files: Mapping[str, str]

    def __str__(self) -> str:
        names = ", ".join(name for name in self.files if "/" not in name)
        return f"{len(self.files)} files in {self.path}: {names}"

    def tree(self) -> dict[str, Any]:
        """Return path and files as plain values for JSON."""
        return {"path": str(self.path), "files": dict(self.files)}


@checked
def publish(
    what: str | Path, out: str | Path, *, licence: str, scores: str | Path | None = None, title: str = ""
) -> PublishedFolder:
    """Write a model or a dataset as a folder ready to upload to the Hugging Face Hub.

    The folder holds the files, a card as ``README.md`` with the Hub's front matter, and ``SHA256SUMS``. Every
    figure of a card comes from the files: from the definition, from ``metrics.json`` of a training run, and
    from ``scores.json`` of an evaluation. Nothing is uploaded.

    Parameters
    ----------
    what
        A training run's folder, a model's folder, a bundled model's name, or a dataset's folder.
    out
        New folder to write.
    licence
        Licence that you publish under, by the Hub's identifier, such as ``"apache-2.0"`` or ``"cc-by-4.0"``.
    scores
        Report folder of an evaluation of this model, or its ``scores.json``: the test in the model's card.
    title
        Title of the card; by default the model's, or the folder's name.

    Returns
    -------
    PublishedFolder
        The folder and its files.

    Raises
    ------
    InputError
        If `what` is neither, `out` exists, the scores are of another model, a file of a run or report is
        damaged, or a file or folder is a symbolic link: what it points to is not yours to publish unseen.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import monochord as mc
    >>> folder = mc.publish("demo", f"{mkdtemp()}/demo", licence="apache-2.0")
    >>> sorted(folder.files)
    ['README.md', 'SOURCES.md', 'model.json', 'weights.safetensors']
    """
    source, folder = Path(what), Path(out)
    if folder.exists():
        raise InputError(f"folder '{folder}', which already exists", "a new folder")
    if not licence or any(mark.isspace() for mark in licence):
        raise InputError(f"licence '{licence}'", "an identifier of the Hub, such as apache-2.0 or cc-by-4.0")
    folder.absolute().parent.mkdir(parents=True, exist_ok=True)
    if (source / FILE).is_file():
        if scores is not None:
            raise InputError(f"scores '{scores}' for a dataset", "scores of a model")
        contents, card = _dataset(source, title)
    else:
        contents, card = _model(source, title, scores)
    for file in contents.values():
        _refuse_link(file, source)
    with part_folder(folder) as part:
        sums = {name: _copied(file, part / name) for name, file in contents.items()}
        text = _card(contents, **card, licence=licence, files=sums)
        (part / CARD).write_text(text, encoding="utf-8")
        sums = {CARD: hashlib.sha256(text.encode()).hexdigest(), **sums}
        (part / SUMS).write_text("".join(f"{sha}  {name}\n" for name, sha in sums.items()), encoding="utf-8")
        part.rename(folder)
    return PublishedFolder(path=folder, files=sums)


def _model(source: Path, title: str, scores: str | Path | None) -> tuple[dict[str, Path], dict[str, Any]]:
    """Return a model's files by name, and what its card says."""
    definition = load(source).definition  # which verifies the checksum of the weights
    folder = folder_of(source)
    assert folder is not None
    contents = {name: folder / name for name in MODEL_FILES if (folder / name).is_file()}
    run = {}
    if (source / METRICS).is_file():
        contents[METRICS] = source / METRICS
        run = load_json(source / METRICS)
    card: Any = {}
    if scores is not None:
        _refuse_link(Path(scores), Path(scores))
        file = Path(scores) / SCORES if Path(scores).is_dir() else Path(scores)
        card = load_json(file)
        tested = card.get("options", {}).get("weights") if isinstance(card, dict) else None
        if tested != definition.weights:
            given = f"{file} of weights {str(tested)[:12]}"
            raise InputError(given, f"scores of weights {definition.weights[:12]}", "evaluate this model")
        if not isinstance(card.get("table"), list):
            raise InputError(f"{file} (damaged: without a table)", "scores that monochord evaluate wrote")
        contents[SCORES] = file
    title = title or definition.title or source.name
    about = {"definition": definition, "facts": facts(definition)[1], "run": run, "scores": card}
    return contents, {"template": "model_card.md.jinja", "title": title, **about}


def _dataset(source: Path, title: str) -> tuple[dict[str, Path], dict[str, Any]]:
    """Return a dataset's files by name, and what its card says."""
    dataset = open_dataset(source)
    dataset.verify()
    split = Split.read(source / SPLIT_FILE)
    names = (FILE, SPLIT_FILE, *dataset.manifest.files)
    largest = next((name for limit, name in LARGEST.items() if len(dataset) < limit), "n>10M")
    about = {"manifest": dataset.manifest, "facts": dataset.facts()[1], "split": split, "size": largest}
    card = {"template": "dataset_card.md.jinja", "title": title or source.resolve().name, **about}
    return {name: source / name for name in names}, card


def _refuse_link(file: Path, source: Path) -> None:
    """Raise `InputError` where a file, a folder that holds it, or `source` itself is a symbolic link."""
    for each in (file, *file.parents):
        if each.is_symlink():
            remedy = "put the file in its place, or name the folder that it points to"
            raise InputError(f"{each} (a symbolic link)", "files and folders, no links", remedy)
        if each == source or not each.is_relative_to(source):
            return


def _card(contents: Mapping[str, Path], *, template: str, **about: Any) -> str:
    """Return the text of a card; a file of scores that it cannot be made of is damaged."""
    import jinja2  # noqa: PLC0415

    try:
        return _rendered(template=template, **about)
    except (
        jinja2.TemplateError,
        TypeError,
        ValueError,
        LookupError,
        AttributeError,
        RecursionError,
    ) as error:
        named = [str(contents[name]) for name in (METRICS, SCORES) if name in contents]
        if not named:
            raise
        given = f"{' or '.join(named)} (damaged: {error})"
        raise InputError(given, "files that monochord train and monochord evaluate wrote") from error


def _copied(file: Path, target: Path) -> str:
    """Copy a file, and return the SHA-256 of the copy."""
    target.parent.mkdir(parents=True, exist_ok=True)
    copyfile(file, target)
    with target.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _rendered(*, template: str, **about: Any) -> str:
    import jinja2  # noqa: PLC0415

    environment = jinja2.Environment(  # noqa: S701  # nosec B701
        trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined, keep_trailing_newline=True
    )
    environment.filters["quoted"] = lambda value: json.dumps(value, ensure_ascii=False)  # as YAML reads it
    text = files("monochord.front").joinpath(template).read_text(encoding="utf-8")
    return environment.from_string(text).render(**about)
