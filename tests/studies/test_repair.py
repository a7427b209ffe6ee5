"""A repair reads what whole chunks hold, and all of it where the start of a session is damaged."""

from studies.repair import FLUSH, FRAMES, measured


def test_a_repair_reads_what_whole_chunks_hold_and_makes_the_start_anew() -> None:
    seconds = 0.5
    rows = {name: [int(each) for each in row] for name, *row in measured(seconds, 3, seed=0)}
    for name, (frames, library, chunks, repaired, *_) in rows.items():
        assert max(library, chunks) <= repaired + FRAMES, name
        assert "truncated" in name or frames <= repaired + 2 * FRAMES, name
    frames, _, chunks, repaired, *_ = rows["a flipped byte before the second chunk"]
    assert chunks < repaired == frames == FRAMES * round(seconds / FLUSH)
