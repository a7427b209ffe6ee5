"""One reader: a pair of lines refines a place, and the network and its heads learn places in seconds."""

from dataclasses import fields, replace

import numpy as np
import pytest
from studies._reader_network import POSITIONS, densest, outputs_of, train_heads, train_network
from studies._reader_windows import KINDS, Windows, windows_of
from studies.one_reader import HEADINGS, measures_of, nearest_pairs, rows_of

from monochord.lab import assignments, load_plan
from monochord.perception.closed_form import CELLS

COUNT = 48


def made(random: np.random.Generator) -> Windows:
    """Windows of two clamped segments of an ideal string, at modes 1 to 3, and of untouched strings."""
    touched = np.arange(COUNT) % 4 > 0
    place = random.uniform(0.25, 0.75, COUNT)
    modes = random.integers(1, 4, (2, COUNT))
    lines, power = np.zeros((COUNT, 2, 8)), np.zeros((COUNT, 2, 8))
    for channel, share in enumerate((place, 1.0 - place)):
        lines[:, channel, 0] = np.where(touched, modes[channel] / share, modes[channel])
        power[:, channel, 0] = 1e-3
    cells = np.zeros((COUNT, 4, CELLS), np.uint8)
    for row in range(COUNT):
        for channel in range(2):
            cell = int(np.log(lines[row, channel, 0] / 0.3) / 0.003)
            cells[row, channel::2, cell - 2 : cell + 3] = 255
    return Windows(
        cells=cells,
        lines=lines,
        power=power,
        spectrum=np.full((COUNT, 2, 300), -9.0, np.float16),
        spacing=np.full(COUNT, 0.01),
        stiffness=np.zeros(COUNT),
        levels=np.zeros((COUNT, 14)),
        pitch_error=np.zeros(COUNT),
        contact=touched.astype(float),
        position=np.where(touched, place, np.nan),
        force=touched.astype(float),
        slip=np.zeros(COUNT),
        kind=np.zeros(COUNT, int),
        build=np.arange(COUNT),
        length=np.full(COUNT, 0.2),
        mount=np.full(COUNT, "bolted"),
    )


@pytest.fixture
def windows() -> Windows:
    return made(np.random.default_rng(0))


def test_the_nearest_pair_of_lines_gives_the_place_and_the_pitch(windows: Windows) -> None:
    touched = windows.of(np.flatnonzero(windows.contact == 1.0))
    pairs = nearest_pairs(touched, touched.position + 0.004)
    np.testing.assert_allclose(pairs.position, touched.position, atol=1e-12)
    np.testing.assert_allclose(pairs.pitch, 1.0)


def test_without_a_pair_nearby_there_is_no_refined_place(windows: Windows) -> None:
    silent = replace(windows, lines=np.zeros_like(windows.lines))
    assert np.isnan(nearest_pairs(silent, np.full(COUNT, 0.5)).position).all()


def test_the_densest_place_lies_between_its_cells() -> None:
    density = np.zeros((1, len(POSITIONS)))
    density[0, 100:102] = 0.5
    place, mass = densest(density)
    assert place[0] == pytest.approx(0.5025)
    assert mass[0] == pytest.approx(1.0)


def test_what_it_learned_it_reads(windows: Windows, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("torch")
    network = train_network(
        windows.cells, windows.contact, windows.position, windows.kind, len(KINDS), epochs=4, seed=0
    )
    losses = [float(line.rsplit(maxsplit=1)[1]) for line in capsys.readouterr().out.splitlines()]
    assert losses[-1] < losses[0]
    outputs = outputs_of(network, windows.cells)
    np.testing.assert_allclose(outputs.untouched + outputs.density.sum(axis=1), 1.0, rtol=1e-5)
    measures, refined = measures_of(windows, outputs)
    labels = {name: getattr(windows, name) for name in ("contact", "position", "force", "slip", "kind")}
    heads = train_heads(measures, refined, labels, seed=0)
    rows = list(rows_of(windows, heads, measures, refined))
    assert [row[0] for row in rows] == ["bolted, inside", "untouched"]
    assert {len(row) for row in rows} == {len(HEADINGS)}


@pytest.mark.slow
def test_a_rendered_session_gives_windows_at_its_own_pitch() -> None:
    session = next(each for each in assignments(load_plan("quick")) if each.group.name == "hold")
    windows = windows_of(session, 6, 0)
    assert windows is not None
    assert {len(getattr(windows, each.name)) for each in fields(Windows)} == {len(windows.contact)}
    assert set(windows.contact.tolist()) == {0.0, 1.0}
    free = windows.of(np.flatnonzero((windows.contact == 0.0) & (windows.kind == 0)))
    pitch = free.lines[:, 0, 0] * (1.0 + free.pitch_error)
    number = np.round(pitch)
    assert np.median(np.abs(pitch / (number * np.sqrt(1.0 + free.stiffness * number**2)) - 1.0)) < 2e-3
