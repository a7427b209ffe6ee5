"""A model on a whole sound: the table that comes of it, its score, and what is refused."""

import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.twins import sound_of

import monochord as mc
from monochord.core.errors import InputError, MissingLibraryError
from monochord.core.labels import LabelTrack
from monochord.core.types import Audio, Floats, Prediction
from monochord.perception.model import EstimateColumn, PredictionTable

RATE = 44100
Take = tuple[Audio, dict[str, Floats]]


@pytest.fixture(scope="module")
def take() -> Take:
    """A build that is off its nominal pitch, untouched for 0.6 s, pressed, and released."""
    twin = mc.VirtualSensor("prototype", seed=1, build=3, day=2)
    return sound_of(twin, 0.6, (0.08, 1.0), 0.6, None, 0.3, material="plastic")


def bits(rows: "list[Prediction] | PredictionTable") -> list[tuple[object, ...]]:
    """Return all that rows say, as values that are equal where their bits are."""
    return [
        (
            row.start,
            row.time,
            name,
            np.float64(e.value).tobytes(),
            np.float64(e.std).tobytes(),
            e.unit,
            e.reason,
        )
        for row in rows
        for name, e in sorted(row.estimates.items())
    ]


@pytest.mark.parametrize(
    ("sensor", "string", "hop"), [("prototype", "", 0.01), ("", "prototype", 0.023), ("", "", 0.03)]
)
def test_a_sound_gives_what_the_live_loop_gives(
    take: Take, tmp_path: Path, sensor: str, string: str, hop: float
) -> None:
    soundfile.write(tmp_path / "take.wav", take[0].T, RATE, subtype="FLOAT")
    updates = mc.listen(tmp_path / "take.wav", "demo", hop=hop, sensor=sensor, string=string)
    live = [update.prediction for update in updates]
    model = mc.load("demo")
    table = model.predict(take[0], sample_rate=RATE, hop=hop, sensor=sensor, string=string)
    assert len(table) == len(live) > 40
    assert table.position.valid.any()
    assert not table.position.valid.all()
    assert bits(table) == bits(live)


def test_a_second_call_knows_nothing_of_the_first(take: Take) -> None:
    model = mc.load("demo")
    once = model.predict(take[0], sensor="prototype", hop=0.05)
    assert bits(model.predict(take[0], sensor="prototype", hop=0.05)) == bits(once)


def test_the_table_has_arrays_and_rows(take: Take) -> None:
    table = mc.load("demo").predict(take[0], sensor="prototype", hop=0.05)
    assert isinstance(table, mc.PredictionTable)
    assert table.time[:3].tolist() == [0.0, 2205 / RATE, 4410 / RATE]
    assert table["position"] is table.position
    column = table.force
    assert isinstance(column, EstimateColumn)
    assert column.value.dtype == column.std.dtype == np.float64
    assert column.valid.dtype == np.bool_
    assert (np.isnan(column.value) == ~column.valid).all()
    assert all(bool(reason) != bool(valid) for reason, valid in zip(column.reason, column.valid, strict=True))
    assert np.array_equal(np.asarray(column), column.value, equal_nan=True)
    assert [row["force"].valid for row in table] == column.valid.tolist()
    assert table[-1].time == table.time[-1]
    assert "position" in dir(table)
    assert f"{len(table)} windows" in repr(table)
    with pytest.raises(ValueError, match="read-only"):
        column.value[0] = 0.0
    with pytest.raises(IndexError):
        _ = table[len(table)]
    with pytest.raises(InputError, match="position"):
        _ = table["postion"]
    with pytest.raises(AttributeError, match="postion"):
        _ = table.postion
    assert bits(pickle.loads(pickle.dumps(table))) == bits(table)  # noqa: S301


def test_the_table_becomes_a_data_frame(take: Take, monkeypatch: pytest.MonkeyPatch) -> None:
    table = mc.load("demo").predict(take[0], sensor="prototype", hop=0.05)
    frame = table.to_pandas()
    assert frame.index.tolist() == table.time.tolist()
    assert np.array_equal(frame["position_std"], table.position.std, equal_nan=True)
    assert list(frame.columns)[:4] == ["contact", "contact_std", "contact_valid", "contact_reason"]
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingLibraryError, match=r"^A data frame requires pandas .*pip install") as refusal:
        table.to_pandas()
    assert "\n" not in str(refusal.value)


def test_the_score_is_the_share_within_5_mm(take: Take) -> None:
    model, (sound, truth) = mc.load("demo"), take
    table = model.predict(sound, sensor="prototype")
    share = model.score(sound, truth, sensor="prototype")
    assert 0.5 < share <= 1.0
    track = LabelTrack(time=np.arange(sound.shape[1]) / RATE, columns=truth)
    assert model.score(sound, track, sensor="prototype") == share
    assert model.score(sound, truth, sensor="prototype", tolerance=0.0) == 0.0
    elsewhere = truth | {"position": truth["position"] + 0.05}
    assert model.score(sound, elsewhere, sensor="prototype") == 0.0
    whole = [truth["contact"][start : start + 4410].mean() >= 0.9 for start in table.start]
    hits = [
        valid and abs(value - 0.08) < 0.005
        for valid, value in zip(table.position.valid, table.position.value, strict=True)
    ]
    assert share == pytest.approx(np.mean(np.array(hits)[whole]))


def test_what_cannot_be_used_is_refused_in_one_line(take: Take, tmp_path: Path) -> None:
    model, (sound, truth) = mc.load("demo"), take
    with pytest.raises(InputError, match=r"sound at 32000 Hz.*44100"):
        model.predict(sound, sample_rate=32000)
    with pytest.raises(InputError, match="100 frames"):
        model.predict(sound[:, :100])
    with pytest.raises(InputError, match="one microphone"):
        model.predict(sound[:1])
    with pytest.raises(InputError, match=r"hop' = 0\.0"):
        model.predict(sound, hop=0.0)
    with pytest.raises(InputError, match="shape"):
        model.predict(sound[0])
    with pytest.raises(InputError, match="without a touch"):
        model.score(sound, truth | {"contact": 0.0 * truth["contact"]})
    with pytest.raises(InputError, match="without position"):
        model.score(sound, {"contact": truth["contact"]})
    with pytest.raises(InputError, match=r"shape \(5,\)"):
        model.score(sound, truth | {"contact": np.ones(5)})
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file"):
        model.save(tmp_path / "file")


def test_a_saved_model_is_loaded_again(take: Take, tmp_path: Path) -> None:
    model = mc.load("demo")
    saved = model.save(str(tmp_path / "mine"))
    again = mc.load(tmp_path / "mine")
    assert again.definition == saved.definition
    sound = take[0][:, : RATE // 2]
    assert bits(again.predict(sound, hop=0.05)) == bits(model.predict(sound, hop=0.05))


def test_the_old_estimator_is_refused_in_one_line() -> None:
    with pytest.raises(ImportError, match=r"^monochord.TouchEstimator: .*scikit-learn"):
        exec("from monochord import TouchEstimator")  # noqa: S102
    with pytest.raises(ImportError, match=r"^monochord.TouchEstimator: .*scikit-learn"):
        _ = mc.TouchEstimator  # pyright: ignore[reportAttributeAccessIssue]
