"""The documentation's pictures of the page show the page as it is; those of another page are taken anew."""

from pathlib import Path

import pytest
from tests.e2e.browser import chromium
from tests.e2e.pictures import FIGURES, OF_THE_PAGE, mark, page_of, take_the_page, todays_page


@pytest.mark.slow
@pytest.mark.real_time
@pytest.mark.timeout(600)
@pytest.mark.skipif(chromium() is None, reason="Chromium is not installed (Debian: apt install chromium)")
def test_the_pictures_are_of_todays_page() -> None:
    stale = [name for name in OF_THE_PAGE if page_of(FIGURES / name) != todays_page()]
    if stale:
        take_the_page()
        assert [page_of(FIGURES / name) for name in OF_THE_PAGE] == [todays_page()] * len(OF_THE_PAGE)
        pytest.fail(f"{', '.join(stale)} showed an earlier page and are taken anew: look at them, and commit")


def test_a_picture_says_which_page_it_shows_and_stays_a_picture(tmp_path: Path) -> None:
    image = pytest.importorskip("matplotlib.image")
    copy = tmp_path / "page.png"
    copy.write_bytes((FIGURES / OF_THE_PAGE[0]).read_bytes())
    before = image.imread(copy)
    mark(copy, "0123abcd")
    assert "0123abcd" in copy.read_bytes().decode("latin-1")
    assert (image.imread(copy) == before).all()
