"""Evaluation's results whose scores are known, and YAMNet's package."""

from tests.evaluation.conftest import _oracle, oracle
from tests.packages.conftest import yamnet_package

__all__ = ["_oracle", "oracle", "yamnet_package"]
