"""What a window passes through, counted on calls whose path is known."""

import json
import sys
from types import ModuleType

import pytest
from click.testing import CliRunner
from studies.window_path import command, counts_of

from monochord.core.kernels import compile_lazily
from monochord.core.types import Estimate


def test_functions_files_and_moves_of_the_package_are_counted() -> None:
    counts = counts_of(lambda: str(Estimate(value=0.08, std=3e-4, unit="m")))
    assert 1 <= counts["files"] <= counts["functions"] <= counts["calls"]
    assert counts["kernels"] == 0
    assert counts_of(lambda: sorted([2, 1], key=lambda each: -each))["functions"] == 0


def test_a_kernel_counts_with_those_that_it_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    @compile_lazily
    def half(x: float) -> float:
        return 0.5 * x

    @compile_lazily
    def quarter(x: float) -> float:
        return half(half(x))

    module = ModuleType("monochord.made_up")
    vars(module).update(half=half, quarter=quarter)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    assert quarter(1.0) == 0.25  # compiled before the count
    assert counts_of(lambda: quarter(1.0))["kernels"] == 2
    assert counts_of(lambda: half(1.0))["kernels"] == 1


@pytest.fixture(scope="module")
def table() -> dict[str, dict[str, int]]:
    """Return what windows of the bundled model pass."""
    said = CliRunner().invoke(command, ["--windows", "250", "--json"])
    assert said.exit_code == 0, said.output
    return json.loads(said.output)


@pytest.mark.slow
def test_a_window_of_the_bundled_model_is_counted(table: dict[str, dict[str, int]]) -> None:
    assert min(table["windows"].values()) > 10
    typical, most = table["touched median"], table["touched max"]
    assert all(0 < typical[name] <= most[name] for name in ("files", "functions", "calls", "moves"))
    assert typical["files"] <= typical["functions"] + typical["kernels"]


@pytest.mark.slow
@pytest.mark.xfail(raises=AssertionError, reason="26, with what two channels carry: docs/ROADMAP.md")
def test_a_window_passes_at_most_twenty_files(table: dict[str, dict[str, int]]) -> None:
    assert all(table[f"{kind} max"]["files"] <= 20 for kind in ("touched", "untouched"))
