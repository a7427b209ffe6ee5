"""The page with all that it can do: a run's page also records, guides, and designs a sensor."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from monochord.core.workers import Worker
from monochord.live.sinks.base import PageSink, Sink

if TYPE_CHECKING:
    from monochord.page.server import Page

NICENESS = 5
"""Of the process that computes designs: a running sensor goes first."""


def with_page(sinks: Iterable[Sink]) -> tuple[Sink, ...]:
    """Return sinks; a page among them can record, guide and design, beside showing the run.

    >>> from monochord.live.sinks import SINKS
    >>> udp = SINKS.build("udp")
    >>> with_page([udp]) == (udp,)
    True
    """
    return tuple(_whole(each) if isinstance(each, PageSink) else each for each in sinks)


def design_page() -> "Page":
    """Return the page of a design, for a server."""
    # Loaded where a page is served: a web server, and in its process what computes a design.
    from monochord.front.design_page import encoded_answer  # noqa: PLC0415
    from monochord.page import design  # noqa: PLC0415

    return design.design_page(Worker(encoded_answer, niceness=NICENESS))


def _whole(page: PageSink) -> Sink:
    from monochord.live.guides.run_tasks import RunTasks  # noqa: PLC0415  (what a recording and a tuning take)

    return page.with_tasks(RunTasks, pages=(design_page(),))
