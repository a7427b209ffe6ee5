"""The names in the code are made of words: a name that a search-and-replace spoiled is found here."""

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from tests.contract.test_layout import PAGES, ROOT

SOURCES = [
    file
    for folder in ("src", "packages", "studies", "examples")
    for file in sorted((ROOT / folder).rglob("*.py"))
]
MIN_LENGTH = 4
"""Letters of the shortest part of a name that must be a word; shorter ones are abbreviations."""
ENDINGS = ("s", "es", "ed", "d", "ing", "er", "r", "ly", "ness", "less", "able", "ation", "ment", "ies")
BEGINNINGS = ("un", "re", "de", "non", "pre")
WORDS = Path(__file__).with_name("words.txt")
"""Words of names that no comment, docstring or page has."""


def parts(text: str) -> list[str]:
    """Return the words of a name or a text, in lower case."""
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", text)]


def names(tree: ast.AST) -> Iterator[str]:
    """Yield the names that code defines, not those that it uses of a library."""
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                yield name
            case (
                ast.arg(arg=name)
                | ast.Name(id=name, ctx=ast.Store())
                | ast.Attribute(attr=name, ctx=ast.Store())
            ):
                yield name
            case _:
                pass


def texts(source: str, tree: ast.AST) -> Iterator[str]:
    """Yield comments and texts of more than one word, without what they quote from the code."""
    yield from re.findall(r"#\s.*", source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            yield re.sub("`[^`]*`", "", node.value)


def is_word(part: str, words: set[str]) -> bool:
    """Return whether a part of a name is one of `words`, or a form of one."""
    if len(part) < MIN_LENGTH or part in words:
        return True
    stems = {part.removesuffix(ending) for ending in ENDINGS} | {
        part.removeprefix(each) for each in BEGINNINGS
    }
    stems |= {stem[:-1] for stem in stems if len(stem) > MIN_LENGTH and stem[-1] == stem[-2]}
    forms = {stem + ending for stem in stems for ending in ("", "e", "y", "ate", *ENDINGS)}
    return bool({form for form in forms if len(form) >= MIN_LENGTH} & words)


def strange(sources: dict[Path, str], pages: list[str]) -> dict[str, set[str]]:
    """Return the parts of names that are no words, each with the places of its names."""
    words, places = set(WORDS.read_text(encoding="utf-8").split()), defaultdict[str, set[str]](set)
    trees = {file: ast.parse(source) for file, source in sources.items()}
    for file, source in sources.items():
        words.update(*map(parts, texts(source, trees[file])))
    words.update(*map(parts, pages))
    for file, tree in trees.items():
        for name in names(tree):
            for part in parts(name):
                places[part].add(f"{file.name}: {name}")
    return {part: found for part, found in places.items() if not is_word(part, words)}


def test_a_spoiled_name_is_found() -> None:
    source = (
        "def sync(self):  # the latest delays of a sync itself\n    self._delaysst = self.latest_delay = 0"
    )
    assert strange({Path("sync.py"): source}, ["self"]) == {"delaysst": {"sync.py: _delaysst"}}


def test_names_are_made_of_words() -> None:
    """A new word that is right and that no text has belongs into words.txt."""
    assert not strange({file: file.read_text(encoding="utf-8") for file in SOURCES}, list(PAGES.values()))
