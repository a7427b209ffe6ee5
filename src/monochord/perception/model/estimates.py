"""From what heads answer to estimates: calibrated, in the label's unit, or an abstention that says why."""

import math
from collections.abc import Mapping

from monochord.core.types import Estimate
from monochord.perception.heads.base import Loss
from monochord.perception.model.definition import Definition, HeadRecord
from monochord.perception.model.network import Answer

NO_CONTACT, UNSURE = "no contact", "too unsure"
LEAST_CONTACT = 0.5
"""Probability of contact from which there is a touch to speak of."""
MOST_LOGIT = 700.0
SPREADS: Mapping[Loss, float] = {"gauss": 1.0, "laplace": math.sqrt(2.0)}
"""Standard deviations in a unit of the spread that is learned."""


def probability(answer: Answer, record: HeadRecord) -> float:
    """Return the calibrated probability of a yes.

    After n windows of calibration it is never nearer to 0 or 1 than 1 / (n + 2), the rule of succession: so
    many windows without an error say no more.

    >>> from monochord.perception.heads.base import Task
    >>> round(probability(Answer(value=0.0), HeadRecord(task=Task(label="slip", loss="logistic"))), 3)
    0.5
    """
    logit = answer.value / record.calibration.factor
    most = math.log(record.calibration.windows + 1.0) if record.calibration.windows else MOST_LOGIT
    return 1.0 / (1.0 + math.exp(-min(max(logit, -most), most)))


def amount(answer: Answer, record: HeadRecord) -> tuple[float, float]:
    """Return an amount and its calibrated standard error, in the unit of the label."""
    spread = SPREADS.get(record.task.loss, 1.0) * math.exp(min(max(answer.log_spread, -20.0), 20.0))
    return record.offset + record.scale * answer.value, record.scale * record.calibration.factor * spread


def estimates(definition: Definition, answers: Mapping[str, Answer]) -> dict[str, Estimate]:
    """Return the estimates of all heads; those that need a touch abstain where there is none.

    The standard error of a probability p is that of the yes or no which it tells of, sqrt(p (1 - p)).
    """
    gate = definition.gate
    touched = probability(answers[gate], definition.heads[gate]) >= LEAST_CONTACT
    found: dict[str, Estimate] = {}
    for name, record in definition.heads.items():
        task = record.task
        if task.touched and not touched:
            found[name] = Estimate.abstain(task.unit, NO_CONTACT)
            continue
        if task.is_chance:
            chance = probability(answers[name], record)
            value, std = chance, math.sqrt(chance * (1.0 - chance))
        else:
            value, std = amount(answers[name], record)
        is_sure = std <= task.limit
        found[name] = (
            Estimate(value=value, std=std, unit=task.unit) if is_sure else Estimate.abstain(task.unit, UNSURE)
        )
    return found


def abstentions(definition: Definition, why_not: str) -> dict[str, Estimate]:
    """Return an abstention of every head, for a window that cannot be used."""
    return {name: Estimate.abstain(record.task.unit, why_not) for name, record in definition.heads.items()}
