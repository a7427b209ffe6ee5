"""Pitch is as good as theory allows, within a small factor, and knows how good it is."""

from studies.pitch_bound import Bound


def test_errors_are_near_the_bound_and_claims_honest() -> None:
    rows = {row.name: row for row in Bound(ratios=(10.0, 0.0), windows=120).run()}
    for ratio in ("10 dB", "0 dB"):
        # Of 120 windows judged alone; a note that is followed has none.
        assert rows[f"{ratio}: gross errors"].value <= (0.0 if ratio == "10 dB" else 2.0)
        over = rows[f"{ratio}: error of f0"].ratio
        assert over is not None
        assert 0.8 < over < 3.0
        assert 0.4 < rows[f"{ratio}: error over claim"].value < 1.5
