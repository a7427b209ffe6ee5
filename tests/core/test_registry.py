"""The registry itself, over a folder made for the test; the real folders are in tests/contract/."""

import sys
from abc import ABC, abstractmethod
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

from monochord.core.errors import InputError
from monochord.core.registry import Registry

BASE = """
from abc import ABC, abstractmethod

class Bell(ABC):
    @abstractmethod
    def ring(self) -> str: ...
"""
GONG = """
from dataclasses import dataclass
from bellfoundry.bells.base import Bell

class _Hidden(Bell):
    pass

@dataclass(frozen=True, kw_only=True)
class HandGong(Bell):
    size: float = 1.0

    def ring(self) -> str:
        return f"gong {self.size}"
"""


class Bell(ABC):
    @abstractmethod
    def ring(self) -> str: ...


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    bells = tmp_path / "bellfoundry" / "bells"
    bells.mkdir(parents=True)
    (bells.parent / "__init__.py").touch()
    (bells / "__init__.py").touch()
    (bells / "base.py").write_text(BASE, encoding="utf-8")
    (bells / "_casting.py").touch()
    (bells / "hand_gong.py").write_text(GONG, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    yield bells
    for name in [name for name in sys.modules if name.startswith("bellfoundry")]:
        del sys.modules[name]


@pytest.fixture
def bells(folder: Path) -> Registry[Bell]:
    return Registry("bellfoundry.bells", import_module("bellfoundry.bells.base").Bell)


def test_names_are_the_public_files_and_nothing_is_imported(bells: Registry[Bell], folder: Path) -> None:
    (folder / "broken.py").write_text("1 / 0", encoding="utf-8")
    assert bells.names() == ["broken", "hand_gong"]
    assert "bellfoundry.bells.hand_gong" not in sys.modules


@pytest.mark.parametrize("name", ["hand_gong", "hand-gong"])
def test_a_plug_in_is_built_by_its_file_name(bells: Registry[Bell], name: str) -> None:
    assert bells.build(name, {"size": 2}).ring() == "gong 2.0"
    assert bells.build(name).ring() == "gong 1.0"


def test_an_unknown_name_is_refused_with_a_suggestion(bells: Registry[Bell]) -> None:
    with pytest.raises(InputError, match=r"'hand-gnog'.*'hand_gong'"):
        bells.load("hand-gnog")


@pytest.mark.parametrize("name", ["base", "_casting", "", "hand_gong.HandGong", "../base"])
def test_what_is_no_plug_in_is_no_name(bells: Registry[Bell], name: str) -> None:
    with pytest.raises(InputError, match="hand_gong"):
        bells.load(name)


def test_an_unknown_option_is_refused_with_a_suggestion(bells: Registry[Bell]) -> None:
    with pytest.raises(InputError, match=r"hand_gong\.sise.*'size'"):
        bells.build("hand_gong", {"sise": 2})


@pytest.mark.parametrize("extra", ["", GONG + "\nclass Second(HandGong): pass\n"])
def test_a_file_with_none_or_two_plug_ins_is_a_fault(bells: Registry[Bell], folder: Path, extra: str) -> None:
    (folder / "odd.py").write_text(extra, encoding="utf-8")
    with pytest.raises(TypeError, match=r"bellfoundry\.bells\.odd"):
        bells.load("odd")


def test_an_imported_plug_in_is_not_the_files_own(bells: Registry[Bell], folder: Path) -> None:
    text = GONG.replace("HandGong", "Chime") + "\nfrom bellfoundry.bells.hand_gong import HandGong\n"
    (folder / "chime.py").write_text(text, encoding="utf-8")
    assert bells.load("chime").__name__ == "Chime"


def test_a_plug_in_that_fails_to_import_fails_loudly(bells: Registry[Bell], folder: Path) -> None:
    (folder / "broken.py").write_text("1 / 0", encoding="utf-8")
    with pytest.raises(ZeroDivisionError):
        bells.load("broken")


def test_a_name_of_before_is_told_where_it_is_now(folder: Path) -> None:
    base = import_module("bellfoundry.bells.base").Bell
    bells: Registry[Bell] = Registry("bellfoundry.bells", base, {"great_gong": "belfry"})
    with pytest.raises(InputError, match=r"great-gong.*pip install belfry"):
        bells.load("great-gong")
    assert "great_gong" not in bells.names()
