import json

from monochord.core.types import Estimate, Prediction, StreamHealth
from monochord.live.delivery import Delivered
from monochord.live.summary import LoopMeter


def prediction(*, valid: bool, latency: float) -> Prediction:
    position = Estimate(value=0.1, std=0.001, unit="m") if valid else Estimate.abstain("m", "silence")
    return Prediction(start=0, time=0.0, estimates={"position": position}, latency=latency)


def metered() -> LoopMeter:
    meter = LoopMeter(deadline=0.01)
    for k in range(10):
        estimated = prediction(valid=k < 7, latency=0.02 if k < 2 else 0.001)
        meter.add(estimated, read=1e-4, estimate=1e-3, follow=1e-4, sinks=2e-4)
    meter.skip()
    meter.add_capture(None, 5.0)
    meter.add_capture(4.5, 5.0)
    return meter


def test_everything_is_counted_once() -> None:
    summary = metered().summary(441, StreamHealth(gaps=3))
    assert (summary.windows, summary.valid, summary.skipped, summary.deadline_misses) == (10, 7, 1, 2)
    assert {name: seen.count for name, seen in summary.stages.items()} == {
        "read": 10,
        "estimate": 10,
        "follow": 10,
        "sinks": 10,
        "latency": 10,
        "capture": 1,
    }
    assert summary.stages["latency"].longest == 0.02
    assert summary.stages["capture"].longest == 0.5


def test_a_window_without_a_position_is_not_valid() -> None:
    meter = LoopMeter(deadline=1.0)
    meter.add(Prediction(start=0, time=0.0, estimates={}), read=0.0, estimate=0.0, sinks=0.0)
    assert meter.summary(0, StreamHealth()).valid == 0


def test_the_tree_is_plain_json() -> None:
    tree = json.loads(json.dumps(metered().summary(441, StreamHealth(gaps=3)).tree(), allow_nan=False))
    assert tree["windows"] == 10
    assert tree["health"]["gaps"] == 3
    assert tree["stages"]["latency"]["longest"] == 0.02


def test_what_each_sink_got_is_in_the_tree() -> None:
    sinks = (
        Delivered(sink="csv", written=10, left_out=0),
        Delivered(sink="udp", written=7, left_out=3),
        Delivered(sink="mcap", written=4, left_out=6, failure="No space left on device"),
    )
    summary = metered().summary(441, StreamHealth(), sinks)
    assert [line.split()[1] for line in summary.lines() if line.startswith("sink ")] == ["udp", "mcap"]
    tree = json.loads(json.dumps(summary.tree()))
    assert [each["left_out"] for each in tree["delivered"]] == [0, 3, 6]
