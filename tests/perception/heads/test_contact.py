"""The head `contact`."""

from monochord.perception.heads.contact import Contact


def test_it_is_logistic_regression() -> None:
    task = Contact().task()
    assert (task.label, task.loss, task.hidden) == ("contact", "logistic", ())


def test_layers_and_weight_are_its_options() -> None:
    task = Contact(hidden=(16, 8), weight=0.5).task()
    assert (task.hidden, task.weight) == ((16, 8), 0.5)
