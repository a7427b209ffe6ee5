"""A scorecard as lines for a terminal."""

from monochord.evaluation.detection import Detection
from monochord.evaluation.regression import Regression
from monochord.evaluation.scorecard import Scorecard


def lines(card: Scorecard) -> list[str]:
    """Return the table of a scorecard: a line for each object and condition, of all touched windows."""
    kind = ", simulated" if card.simulated else ""
    counted = f"{card.windows} windows of {card.sessions} sessions"
    wide = max([len(row.object) for row in card.table] + [6])
    held = max([len(row.condition) for row in card.table] + [9])
    found = [f"{card.estimator}{kind}: {counted}", *(f"note: {note}" for note in card.notes)]
    found.append(
        f"  {'object':<{wide}}  {'condition':<{held}}{'windows':>9}{'told':>8}"
        f"{'error':>10}{'<= 5 mm':>9}{'r':>7}{'error':>10}{'<= 0.2 N':>9}{'r':>7}"
        f"{'contact':>9}{'slip area':>11}"
    )
    for row in card.table:
        if row.state != "touched":
            continue
        contact = card.contact.get(row.object, {}).get(row.condition)
        slip = card.slip.get(row.object, {}).get(row.condition)
        found.append(
            f"  {row.object:<{wide}}  {row.condition:<{held}}{row.position.windows:>9}"
            f"{_share(row.position.answered):>8}{_told(row.position, 1e3, 'mm')}{_told(row.force, 1.0, 'N')}"
            f"{_accuracy(contact):>9}{_area(slip):>11}"
        )
    return found


def _told(told: Regression, factor: float, unit: str) -> str:
    error = "-" if told.mae.value is None else f"{factor * told.mae.value:.3g} {unit}"
    r = "-" if told.r.value is None else f"{told.r.value:.3f}"
    return f"{error:>10}{_share(told.within.value):>9}{r:>7}"


def _share(value: float | None) -> str:
    return "-" if value is None else f"{100.0 * value:.1f} %"


def _accuracy(told: Detection | None) -> str:
    return _share(told.accuracy.value if told else None)


def _area(told: Detection | None) -> str:
    return "-" if told is None or told.area.value is None else f"{told.area.value:.4f}"
