"""The rows of a bank do not overlap."""

from monochord.physics.twin import bank


def test_rows_stand_one_after_the_other() -> None:
    kept = [value for name, value in vars(bank).items() if name.isupper() and name != "EACH"]
    assert sorted(kept) == list(range(bank.rows(1)))
    assert bank.rows(8) - bank.rows(7) == bank.EACH
