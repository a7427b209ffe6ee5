"""The release check's own parts, and what can be said of a release without building it."""

import re
import shlex
import sys
import tomllib
from importlib.metadata import distribution, packages_distributions, requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from ruamel.yaml import YAML
from tests.networks import Networks
from tests.release.__main__ import CHECKS, ONE_LINERS, Release, pythons
from tests.release.base import ROOT, CheckFailedError, run
from tests.release.dockerfile import Container, instructions
from tests.release.page import fetched
from tests.release.sizes import grown, recorded, sizes, table

import monochord as mc

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
DOCKERFILE = (ROOT / "Dockerfile").read_text(encoding="utf-8")
PAGE = (ROOT / "docs/how-to/release.md").read_text(encoding="utf-8")


def core() -> set[str]:
    required = [Requirement(line) for line in requires("monochord") or ()]
    return {canonicalize_name(each.name) for each in required if "extra" not in str(each.marker)}


def test_every_dependency_of_the_core_is_imported() -> None:
    modules: dict[str, list[str]] = {name: [] for name in core()}
    for module, names in packages_distributions().items():
        for name in map(canonicalize_name, names):
            if name in modules:
                modules[name].append(module)
    source = "\n".join(file.read_text(encoding="utf-8") for file in (ROOT / "src").rglob("*.py"))
    unused = [
        name
        for name, tops in modules.items()
        if not any(re.search(rf"^\s*(import|from) {re.escape(top)}\b", source, re.MULTILINE) for top in tops)
    ]
    assert modules
    assert set(unused) <= {"websockets"}  # uvicorn imports it by name


def test_the_recorded_sizes_hold_the_core() -> None:
    assert core() | {"monochord"} <= recorded().keys()
    assert not {"torch", "matplotlib", "pandas", "pyarrow", "pytest"} & recorded().keys()


def test_a_new_package_and_a_larger_one_are_named_and_a_smaller_one_is_not(tmp_path: Path) -> None:
    then = {"a": 10.0, "b": 10.0, "c": 0.1}
    assert grown({"a": 10.9, "b": 5.0, "c": 1.0}, then) == []
    assert [line.split(":")[0] for line in grown({"a": 12.0, "d": 0.1}, then)] == ["a", "d"]
    assert [line.split()[0] for line in table({"a": 1.0}, then).splitlines()] == [
        "package",
        "a",
        "b",
        "c",
        "total",
    ]
    info = tmp_path / "thing-1.0.dist-info"
    info.mkdir()
    (tmp_path / "thing.py").write_bytes(bytes(2_000_000))
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: Thing\nVersion: 1.0\n", encoding="utf-8")
    (info / "RECORD").write_text("thing.py,,\n__pycache__/thing.cpython-311.pyc,,\n", encoding="utf-8")
    assert sizes(tmp_path) == {"thing": 2.0}


def test_the_version_stands_in_one_place() -> None:
    version = PROJECT["version"]
    assert mc.__version__ == distribution("monochord").version
    assert re.fullmatch(r"\d+\.\d+\.\d+", version)
    others = (*ROOT.glob("src/**/*.py"), ROOT / "CITATION.cff", ROOT / "docs/conf.py", ROOT / "Dockerfile")
    assert not [file for file in others if version in file.read_text(encoding="utf-8")]


def test_the_citation_names_what_the_package_names() -> None:
    citation = YAML(typ="safe").load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()
    assert citation["license"] == PROJECT["license"]
    assert [each["name"] for each in citation["authors"]] == [each["name"] for each in PROJECT["authors"]]
    paper = citation["preferred-citation"]
    assert paper["title"] in " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert len(paper["authors"]) == 4


def test_the_page_of_releases_shows_every_check_and_one_liner() -> None:
    assert all(f"`{name}`" in PAGE for name in CHECKS)
    for line in ONE_LINERS.values():
        assert line.format(wheel="./monochord-*.whl").split(" --seconds")[0] in PAGE


def test_the_oldest_python_is_the_required_one() -> None:
    assert PROJECT["requires-python"] == ">=3.11"
    found = pythons()
    assert all(run(path, "-c", "import sys; print('3.%d' % sys.version_info[1])").strip() == name
               for name, path in found.items())  # fmt: skip


def test_the_dockerfile_has_only_steps_that_can_be_carried_out_elsewhere() -> None:
    steps = list(instructions(DOCKERFILE))
    assert steps[0] == ("FROM", "debian:bookworm-slim")
    assert {word for word, _ in steps} <= {
        "FROM", "RUN", "COPY", "ENV", "USER", "WORKDIR", "EXPOSE", "ENTRYPOINT", "CMD",
    }  # fmt: skip
    for _, rest in (step for step in steps if step[0] == "COPY"):
        assert all((ROOT / source).exists() for source in rest.split()[:-1])


def test_instructions_set_up_a_container(tmp_path: Path) -> None:
    (tmp_path / "src").mkdir()
    (tmp_path / "src/one.py").touch()
    (tmp_path / "README.md").touch()
    container = Container(root=tmp_path / "root", context=tmp_path)
    for word, rest in (
        ("COPY", "README.md /build/"),
        ("COPY", "src /build/src"),
        ("ENV", "A=1 B='two words'"),
        ("USER", "someone"),
        ("CMD", '["live", "demo"]'),
    ):
        container.carry_out(word, rest)
    assert {str(file.relative_to(container.root)) for file in container.root.rglob("*.*")} == {
        "build/README.md", "build/src/one.py",
    }  # fmt: skip
    assert container.variables == {"A": "1", "B": "two words"}
    assert "HOME=/home/someone" in container.enter()
    assert container.command == ["live", "demo"]
    with pytest.raises(CheckFailedError, match="HEALTHCHECK"):
        container.carry_out("HEALTHCHECK", "NONE")


def test_a_failed_command_is_named_with_its_last_lines() -> None:
    with pytest.raises(CheckFailedError, match=r"(?s)ended with 3:.*the reason"):
        run(sys.executable, "-c", "import sys; print('the reason'); sys.exit(3)")


def test_what_was_not_built_is_named(tmp_path: Path) -> None:
    with pytest.raises(CheckFailedError, match="build"):
        Release(tmp_path, ()).use()


@pytest.mark.slow
def test_the_containers_page_answers_to_another_network_with_its_token_alone(networks: Networks) -> None:
    steps = dict(instructions(DOCKERFILE))
    command = shlex.split(re.sub(r'[\[\]",]', " ", steps["CMD"]))
    admitted, refused = fetched(networks, [sys.executable, "-m", "monochord", *command])
    assert admitted == "200 True"
    assert refused.startswith("40")
