"""What every plug-in of every folder promises; a new file in a folder is tested here before anything else."""

import dataclasses
import inspect
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from monochord.core.config import from_tree, to_tree
from monochord.core.errors import InputError
from monochord.core.registry import Registry

SRC = Path(__file__).parents[2] / "src" / "monochord"
FOLDERS = sorted(".".join(base.relative_to(SRC.parent).parent.parts) for base in SRC.rglob("base.py"))


def registry_of(folder: str) -> Registry[Any]:
    registries = [value for value in vars(import_module(folder)).values() if isinstance(value, Registry)]
    assert len(registries) == 1, f"{folder} must hold one Registry, not {len(registries)}"
    return registries[0]


PLUGINS = [(registry_of(folder), name) for folder in FOLDERS for name in registry_of(folder).names()]
each_plugin = pytest.mark.parametrize(
    ("registry", "name"), PLUGINS, ids=[f"{r.package.removeprefix('monochord.')}/{n}" for r, n in PLUGINS]
)


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_plug_in_folder_registers_itself(folder: str) -> None:
    registry = registry_of(folder)
    assert registry.package == folder
    assert inspect.isabstract(registry.base)
    assert registry.base.__module__ == f"{folder}.base"
    assert registry.names(), f"{folder} is empty"


@pytest.mark.parametrize("folder", FOLDERS)
def test_nobody_outside_a_folder_names_what_is_in_it(folder: str) -> None:
    """But for benchmarks, which may name what they measure, as tests may.

    Heads have the names of the labels that they learn, and so have some figures; others may test for a label.
    """
    names, package = "|".join(registry_of(folder).names()), re.escape(folder)
    named = re.compile(rf"^\s*from {package}(\.({names})\b| import .*\b({names})\b)", re.MULTILINE)
    kind = folder.rpartition(".")[2].removesuffix("s")
    labelled = ("monochord.perception.heads", "monochord.figures")
    key = kind if folder in labelled else f"name|{kind}"
    chosen = re.compile(rf"\b({key}) == [\"']({names})[\"']")
    for path in SRC.rglob("*.py"):
        package_of = ".".join(path.relative_to(SRC.parent).parent.parts)
        if package_of not in (folder, "monochord.benchmarks"):
            text = path.read_text(encoding="utf-8")
            assert not named.search(text), f"{path} imports a plug-in of {folder}"
            assert not chosen.search(text), f"{path} chooses by a plug-in's name"


@each_plugin
def test_it_is_a_final_frozen_dataclass_of_keywords(registry: Registry[Any], name: str) -> None:
    cls = registry.load(name)
    assert dataclasses.is_dataclass(cls)
    assert not inspect.isabstract(cls)
    assert getattr(cls, "__dataclass_params__").frozen  # noqa: B009
    assert all(field.kw_only for field in dataclasses.fields(cls) if field.init)


@each_plugin
def test_its_class_is_named_after_its_file(registry: Registry[Any], name: str) -> None:
    cls, kind = registry.load(name), registry.base.__name__.lower()
    assert cls.__name__.lower().removesuffix(kind) == name.replace("_", "").removesuffix(kind)


@each_plugin
def test_its_docstring_describes_every_option(registry: Registry[Any], name: str) -> None:
    cls = registry.load(name)
    text = cls.__dict__.get("__doc__") or ""
    assert text
    assert not text.startswith(f"{cls.__name__}("), "that is the docstring that dataclass writes"
    for field in dataclasses.fields(cls):
        if field.init:
            assert re.search(rf"\b{field.name}\b", text), f"{cls.__name__} does not document '{field.name}'"


@each_plugin
def test_its_options_have_defaults_but_what_it_opens(registry: Registry[Any], name: str) -> None:
    fields = [field for field in dataclasses.fields(registry.load(name)) if field.init]
    missing = dataclasses.MISSING
    required = [f.name for f in fields if f.default is missing and f.default_factory is missing]
    assert required in ([], [fields[0].name] if fields else [])


@each_plugin
def test_its_defaults_survive_a_saved_configuration(registry: Registry[Any], name: str) -> None:
    cls = registry.load(name)
    try:
        options = cls()
    except TypeError:
        options = from_tree(cls, {dataclasses.fields(cls)[0].name: "take.wav"})
    assert from_tree(cls, to_tree(options)) == options


@each_plugin
def test_an_option_it_has_not_is_refused(registry: Registry[Any], name: str) -> None:
    with pytest.raises(InputError, match=rf"{name}\.no_such_option"):
        registry.build(name, {"no_such_option": 1})
    for field in dataclasses.fields(registry.load(name)):
        if field.init:
            with pytest.raises(InputError, match=f"'{field.name}'"):
                registry.build(name, {f"{field.name}x": 1})


@each_plugin
def test_a_name_mistyped_is_answered_with_it(registry: Registry[Any], name: str) -> None:
    assert registry.load(name.replace("_", "-")) is registry.load(name)
    if len(name) > 3:
        with pytest.raises(InputError, match=f"'{name}'"):
            registry.load(name[:-1] + "qq")


def test_loading_plug_ins_needs_no_device_library() -> None:
    """Options can be listed and checked on a machine without JACK, PortAudio, DDS or a plotting library."""
    code = (
        "import sys; from importlib import import_module; from monochord.core.registry import Registry\n"
        f"for folder in ['monochord.capture.instruments', *{FOLDERS}]:\n"
        "    for registry in [v for v in vars(import_module(folder)).values() if isinstance(v, Registry)]:\n"
        "        [registry.load(name) for name in registry.names()]\n"
        "    print(*sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    instruments, *_, every = (set(line.split()) for line in run.stdout.splitlines())
    devices = {"jack", "sounddevice", "matplotlib", "torch", "cyclonedds"}
    assert not instruments & (devices | {"monochord.capture.dds.participant", "numba", "scipy"})
    assert not every & devices
