"""A server of the page of a run, alone or with further pages."""

from collections.abc import Sequence

from monochord.live.web.run_page import RunPage
from monochord.page.server import Page, Server


class RunServer(Server):
    """A server whose first page is that of a run, which `show` shows."""

    def __init__(
        self,
        *,
        port: int = 0,
        token: str = "",
        first: str = "",
        names: Sequence[str] = (),
        pages: Sequence[Page] = (),
    ) -> None:
        run_page = RunPage(first)
        super().__init__((run_page.page, *pages), port=port, token=token, names=names)
        self.show = run_page.show
