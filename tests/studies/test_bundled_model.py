"""The bundled model from nothing: which builds teach what, what is true of windows, and both networks."""

from pathlib import Path

import numpy as np
import pytest

from monochord.core.types import Audio
from monochord.lab import assignments, load_plan
from monochord.perception.reader import (
    BANDS,
    CELLS,
    CHANNELS,
    COLUMNS,
    KINDS,
    POSITIONS,
    MemoryNetwork,
    no_memory,
)
from monochord.perception.reader.memory import recall
from monochord.perception.reader.network import activations, memory_inputs
from monochord.physics.sensors import load_sensor
from monochord.physics.theory import open_frequency

pytest.importorskip("torch")

from studies._memory_figures import figures
from studies._memory_training import (
    DENSITY,
    OUTPUTS,
    PARTS,
    Rows,
    elapsed_input,
    outputs_of,
    peaks,
    stated_force,
    train_memory,
)
from studies._reader_sessions import HOP, RATE, Variant, changed, record, sound_file
from studies._reader_training import Examples, read_examples, train_network, write_examples
from studies.bundled_model import HEADS, PLANS, READER, planned, share_of

from studies import _memory_training

ROOT = Path(__file__).parents[2]
SEED = 0
INPUTS = 102 + len(KINDS) + len(COLUMNS) + 3 * BANDS + 96


def test_a_build_teaches_the_reader_or_the_heads_in_all_plans(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    share = np.array([share_of(build, SEED) for build in range(10001, 10301)])
    assert np.mean(share < READER) == pytest.approx(READER, abs=0.06)
    assert np.mean(share >= HEADS) == pytest.approx(1.0 - HEADS, abs=0.06)
    sealed = load_plan(str(ROOT / "studies/plans/sealed_8.toml"))
    trained = {one.build for one in planned(PLANS, SEED)}
    assert not trained & {one.build for one in assignments(sealed, 0)}


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the recorded sound of a short session of touches."""
    folder = tmp_path_factory.mktemp("sounds")
    settings = ['groups=[{name="hold", grid=[3, 2], hold=0.4, builds=[3], days=[4]}]', 'world="plausible"']
    (one,) = assignments(load_plan("small", settings), SEED)
    record(one, folder)
    return sound_file(one, folder)


def test_the_truth_of_windows_is_that_of_the_session(session: Path) -> None:
    own = changed(Variant(file=session, take=None), SEED)
    truth, design = own.truth, load_sensor("prototype")
    touched, untouched = truth.contact == 1.0, truth.contact == 0.0
    begins = np.flatnonzero(np.diff(touched.astype(int)) == 1)
    assert len(begins) == 6
    assert untouched[0]
    assert untouched[-1]
    place = design.string.length * truth.place[touched]
    assert design.range[0] - 0.003 < place.min() < place.max() < design.range[1] + 0.003
    assert 0.0 < np.nanmax(truth.force) < 2.5
    assert np.isnan(truth.force[untouched]).all()
    assert (truth.kind[touched | untouched] == KINDS.index("ordinary")).all()
    assert (truth.placed == (touched | untouched)).all()
    # The string is read at its own pitch: its strongest partials are the untouched string's.
    spectrum = own.analyser().analyse(own.window(3))
    number = spectrum.frequency[:, 0] / open_frequency(own.string)
    assert number == pytest.approx(np.round(number), abs=0.03 * number.max())


@pytest.mark.slow
def test_changes_last_and_are_told(session: Path) -> None:
    plain = changed(Variant(file=session, take=None), SEED)
    kinds = set[str]()
    for take in range(40):
        own = changed(Variant(file=session, take=take), SEED)
        told = {KINDS[kind] for kind in own.truth.kind if kind >= 0} - {"ordinary"}
        kinds |= told
        if told:
            first = np.flatnonzero(own.truth.kind > 0)[0]
            assert (own.truth.kind[first:] == own.truth.kind[first]).all()
            assert not own.truth.placed[first:].any()
        if told == {"microphones swapped"}:
            same = HOP * (np.flatnonzero(own.truth.kind > 0)[-1] - 1)
            error = own.sound[::-1, same:] - plain.sound[:, same:]
            assert np.abs(error).max() < 0.5 * np.abs(plain.sound).max()
    assert len(kinds) >= 3


def test_examples_are_windows_of_the_session(session: Path, tmp_path: Path) -> None:
    variant = Variant(file=session, take=None)
    write_examples(variant, folder=tmp_path, count=30, seed=SEED)
    examples = read_examples([variant.within(tmp_path)])
    assert np.isfinite(examples.position).sum() == 30
    assert np.isnan(examples.position).sum() == 10
    assert examples.cells.shape == (40, CHANNELS, CELLS)


@pytest.mark.slow
def test_the_network_learns_and_runs_as_a_kernel() -> None:
    """Touched windows have a loud line in a cell that moves with the position; untouched ones have none."""
    random = np.random.default_rng(0)
    position = np.where(random.random(2048) < 0.7, random.uniform(0.2, 0.8, 2048), np.nan)
    cells = random.integers(0, 30, (2048, CHANNELS, CELLS)).astype(np.uint8)
    for window, place in zip(cells, position, strict=True):
        if np.isfinite(place):
            for channel, share in enumerate((place, 1.0 - place)):
                cell = round(np.log(1.0 / share / 0.3) / 0.003)
                window[[channel, 2 + channel], cell - 1 : cell + 2] = 255
    force = np.where(np.isfinite(position), 3.0, np.nan).astype(np.float32)
    examples = Examples(
        cells=cells, position=position, kind=np.zeros(2048, np.int64), force=force, slip=force - 3.0
    )
    losses: list[float] = []
    network = train_network(examples, epochs=6, seed=0, report=lambda _, loss: losses.append(loss))
    assert losses[-1] < 0.8 * losses[0]
    outputs = np.array([activations(window.astype(np.float32) / 255.0, network)[1] for window in cells[:20]])
    assert outputs.shape == (20, 1 + len(POSITIONS) + len(KINDS))
    assert np.isfinite(outputs).all()


def _story(random: np.random.Generator, windows: int) -> Rows:
    """Return rows of a session whose windows show a touch only while it begins and ends."""
    contact, shown = np.zeros(windows, np.float32), np.zeros(windows)
    for begin in range(10, windows - 30, 40):
        contact[begin : begin + 12] = 1.0
        shown[begin : begin + 6], shown[begin + 12 : begin + 18] = 1.0, -1.0
    inputs = random.normal(0.0, 0.3, (windows, INPUTS))
    inputs[:, ::8] += shown[:, np.newaxis]
    touched, place = contact == 1.0, 0.4
    force = random.uniform(0.8, 1.2, windows).astype(np.float32)
    nan = np.full(windows, np.nan, np.float32)
    return Rows(
        inputs=inputs.astype(np.float16),
        density=np.full((windows, DENSITY), -5.0, np.float16),
        contact=contact,
        place=np.where(touched, np.float32(place), nan),
        force=np.where(touched, force, nan),
        slip=np.where(touched, np.float32(0.0), nan),
        kind=np.zeros(windows, np.int8),
        placed=np.ones(windows, bool),
        session=np.zeros(windows, np.int32),
    )


@pytest.mark.slow
def test_the_memory_learns_what_no_window_shows_and_its_arrays_say_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(_memory_training, "LANES", 16)
    monkeypatch.setattr(_memory_training, "STEPS", 40)
    monkeypatch.setattr(_memory_training, "LEARNING", 1.0e-2)
    monkeypatch.setattr(_memory_training, "WARMING", 20)
    random = np.random.default_rng(1)
    stories = [_story(random, 200) for _ in range(80)]
    arrays = train_memory(
        Rows.joined(stories[:-10]), np.ones(70), updates=600, seed=0, report=lambda _number, _loss: None
    )
    outputs = [*outputs_of(arrays, stories[-10:])]
    assert outputs[0].shape == (200, OUTPUTS)
    result = figures(arrays, stories[-10:], ["story"] * 10)["all"]
    # Half of a touch's windows look untouched: without memory, 6 of 40 windows are wrong.
    assert result["memory"]["contact"] > 0.93
    assert result["memory"]["force_n"] < 0.2
    network, memory, told = MemoryNetwork(**arrays), no_memory(), list[Audio]()
    for k, (row, density) in enumerate(zip(stories[-10].inputs, stories[-10].density, strict=True)):
        now = row.astype(np.float32), density.astype(np.float32)
        memory, both = recall(memory, *now, k * HOP / RATE, network)
        told.append(np.concatenate((both.logits, both.kinds, both.outputs), dtype=np.float32))
    assert np.array(told) == pytest.approx(outputs[0], abs=1e-3)
    (alone,) = outputs_of(arrays, stories[-10:-9], 1)
    for k in (0, 25, 199):
        row, density = (each[k].astype(np.float32) for each in (stories[-10].inputs, stories[-10].density))
        assert recall(no_memory(), row, density, 0.0, network)[1].logits == pytest.approx(
            alone[k, :DENSITY], abs=1e-3
        )
    (short,) = outputs_of(arrays, stories[-10:-9], 40)
    assert short[:40] == pytest.approx(outputs[0][:40], abs=1e-4)
    assert np.abs(short - outputs[0]).max() > 1e-3


def test_inputs_of_the_memory() -> None:
    random = np.random.default_rng(0)
    hidden, logits, kinds = (
        random.random(96).astype(np.float32),
        random.normal(size=DENSITY),
        random.normal(size=10),
    )
    measures, gaps = random.normal(size=len(COLUMNS)), random.normal(size=(3, BANDS))
    inputs, density = memory_inputs(hidden, logits, kinds, measures, gaps)
    assert inputs.shape == (INPUTS,)
    assert np.exp(density).sum() == pytest.approx(1.0 + DENSITY * 1e-4)
    assert np.exp(inputs[PARTS["density"]]).sum() == pytest.approx(1.0 + 102 * 1e-4)
    assert inputs[PARTS["kinds"]].max() == pytest.approx(0.0)
    assert inputs[PARTS["measures"]] == pytest.approx(measures)
    assert inputs[PARTS["gaps"]] == pytest.approx(gaps.ravel())
    assert inputs[PARTS["hidden"]] == pytest.approx(hidden)
    assert elapsed_input(np.array([0, 1, 2, 50, 500])).tolist() == pytest.approx(
        [0, 0, 1, 5.644, 5.644], abs=1e-3
    )
    assert pytest.approx(0.02) == HOP / RATE


def test_forces_and_peaks_of_outputs() -> None:
    assert stated_force(np.array([0.0, 2.4, 2.5 * (1.0 + np.log(2.0))])) == pytest.approx([0.0, 2.4, 5.0])
    density = np.zeros((2, DENSITY))
    density[0, 1 + 98 : 1 + 103], density[1, 1] = 0.2, 0.6
    place, mass = peaks(density)
    assert place == pytest.approx([0.5, 0.0], abs=0.006)
    assert mass == pytest.approx([1.0, 0.6], abs=0.21)
