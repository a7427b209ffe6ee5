"""Take the documentation's pictures of the page, on a quiet machine: ``python -m tests.e2e.pictures``."""

import tempfile
import time
from pathlib import Path

from tests.e2e.browser import Page, opened
from tests.e2e.test_web import READY, String, demonstration

FIGURES = Path(__file__).parents[2] / "docs" / "figures"
SETTLED = 8.0  # seconds; the history is to show something


def slide(page: Page) -> None:
    """Lead a touch along the string, and leave it there."""
    string = String(page)
    string.mouse("mousePressed", 0.3)
    time.sleep(1.0)
    for step in range(60):
        string.mouse("mouseMoved", 0.3 + 0.005 * step)
        time.sleep(0.03)


def main() -> None:
    """Take a picture in light, of the whole page in dark, and on a phone."""
    with (
        tempfile.TemporaryDirectory() as folder,
        demonstration(Path(folder)) as started,
        opened(started.address) as page,
    ):
        page.size(1200, 1060)
        page.scheme("light")
        page.wait(READY)
        time.sleep(SETTLED)
        slide(page)
        page.picture(FIGURES / "page_light.png")
        page.scheme("dark")
        time.sleep(0.5)
        page.picture(FIGURES / "page_dark.png", whole=True)
        String(page).mouse("mouseReleased", 0.6)
        page.size(360, 760, scale=2.0, mobile=True)
        page.scheme("light")
        page.wait("monochord.moment.truth.contact === 0")
        slide(page)
        page.picture(FIGURES / "page_phone.png")


if __name__ == "__main__":
    main()
