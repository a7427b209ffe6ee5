import json
from pathlib import Path

from monochord.capture.recording import FeedSummary, RecordingSummary

FEED = FeedSummary(
    stream="wrench", readings=70000, missing=3, faulty=0, out_of_order=0, reconnects=1, rate=6999.7
)
SUMMARY = RecordingSummary(
    path=Path("take.mcap"),
    seconds=10.0,
    frames=441000,
    dropped=512,
    gaps=1,
    xruns=2,
    reconnects=0,
    peak=(0.5, 0.0),
    clipped=(3, 4),
    not_numbers=(0, 0),
    instruments={"net_ft": FEED},
    flags={"gap": 1, "missing": 2},
    size=8_000_000,
    stopped="stopped by request",
)


def test_its_lines_have_the_counts() -> None:
    head, audio, force, flags = SUMMARY.lines()
    assert head == "take.mcap  10.0 s  8.0 MB  stopped by request"
    for part in ("frames 441000", "dropped 512", "gaps 1", "xruns 2", "clipped 7", "peak -6.0 / -inf dBFS"):
        assert part in audio
    assert "not numbers" not in audio
    assert force == "net_ft  readings 70000  missing 3  faulty 0  reconnects 1  6999.7 a second"
    assert flags == "flags  gap 1, missing 2"


def test_its_tree_is_json() -> None:
    tree = json.loads(json.dumps(SUMMARY.tree()))
    assert tree["path"] == "take.mcap"
    assert tree["instruments"]["net_ft"]["missing"] == 3
    assert tree["clipped"] == [3, 4]
    assert tree["failure"] == ""
