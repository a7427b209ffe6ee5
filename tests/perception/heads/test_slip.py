"""The head `slip`."""

from monochord.perception.heads.slip import Slip


def test_it_is_logistic_regression() -> None:
    task = Slip().task()
    assert (task.label, task.loss, task.hidden) == ("slip", "logistic", ())


def test_layers_and_weight_are_its_options() -> None:
    task = Slip(hidden=(16, 8), weight=0.5).task()
    assert (task.hidden, task.weight) == ((16, 8), 0.5)
