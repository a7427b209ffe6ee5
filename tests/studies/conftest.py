"""Results whose scores are known, and sessions of the twin: the fixtures of evaluation."""

from tests.evaluation.conftest import _oracle, dataset, oracle, sessions

__all__ = ["_oracle", "dataset", "oracle", "sessions"]
