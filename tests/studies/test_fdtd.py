"""The benchmark of the paper's finite differences, kept short."""

from studies.fdtd import Fdtd


def test_every_row_stands_beside_its_baseline() -> None:
    rows = {row.name: row for row in Fdtd(seconds=0.3, reference_seconds=0.005, repeats=3).run()}
    compiled, modal = rows["compiled FDTD, core/audio"], rows["exact modes, core/audio"]
    assert compiled.ratio is not None
    assert compiled.ratio < 0.2
    assert modal.ratio is not None
    assert modal.ratio < 0.5  # a tenth on a quiet machine: a shared one must not fail this
    assert modal.baseline_value == compiled.value
    for route in ("compiled FDTD", "exact modes"):
        assert rows[f"{route}, core/audio"].value <= 1.05 * rows[f"{route}, wall/audio"].value
    assert rows["compiled against reference, relative"].value < 1e-11
    assert 0.0 < rows["FDTD off modes, relative"].value < 0.05
    for name in ("peaks of FDTD off theory, relative", "peaks of modes off theory, relative"):
        assert rows[name].value < 1e-3
    assert rows["the same at half the steps"].value < 0.35 * rows["FDTD off modes, relative"].value
