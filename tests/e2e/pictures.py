"""Take the documentation's pictures of the pages and of the live view: ``python -m tests.e2e.pictures``.

A picture of the page is marked with the page that it shows; `test_pictures` takes those of another page anew.
It shows no warning and no skipped windows: on a machine that is too busy for that, the old ones stay.
"""

import base64
import json
import re
import struct
import subprocess
import sys
import tempfile
import time
import zlib
from collections.abc import Iterator
from hashlib import sha256
from io import StringIO
from pathlib import Path

from rich.console import Console
from rich.terminal_theme import TerminalTheme
from rich.text import Text
from tests.e2e.browser import BRING_UP, Page, opened
from tests.e2e.test_web import READY, String, demonstration, on_a_terminal

from monochord.front.page import design_page
from monochord.lab.demonstration import UNSEEN
from monochord.page.server import Server

SOURCES = Path(__file__).parents[2] / "src" / "monochord"
STATIC = (SOURCES / "live" / "web" / "static", SOURCES / "page" / "static")
OF_THE_PAGE = ("page_light.png", "page_dark.png", "page_phone.png")
LATE = "[...document.querySelectorAll('#notes .note')].some((each) => each.dataset.level !== 'info')"
"""Whether the page warns, as it does where the machine is too busy."""
MARK = b"page"
"""Keyword of the text in a picture that says which page it shows."""
FIGURES = Path(__file__).parents[2] / "docs" / "figures"
PATIENCE = 240.0  # seconds; for a sweep, and for kernels that are compiled first
SETTLED = 8.0  # seconds; the history is to show something
COLUMNS, ROWS = 84, 26
INTO_A_SLIDE = 3  # pictures in a row in which truth and estimate both say that the touch slides
DARK = TerminalTheme(
    (18, 20, 23), (225, 222, 215),
    [(48, 53, 60), (255, 143, 132), (110, 192, 118), (242, 178, 92),
     (120, 160, 255), (189, 161, 255), (95, 211, 200), (225, 222, 215)],
    [(110, 115, 122), (255, 160, 150), (143, 209, 147), (255, 200, 120),
     (150, 180, 255), (205, 185, 255), (120, 225, 215), (245, 242, 235)],
)  # fmt: skip
TERMINAL = """<html><meta charset="utf-8"><style>
body {{ margin: 0; color: #e1ded7; background: #121417; }}
pre {{ margin: 0; padding: 14px 10px; width: max-content; font: 16px/20px 'DejaVu Sans Mono', monospace; }}
i {{ display: inline-block; width: 1ch; height: 20px; vertical-align: top; font-style: normal; }}
i b {{ display: inline-block; font-weight: 400; transform-origin: left; transform: scaleX(0.82); }}
</style><body><pre>{code}</pre></body></html>"""


def slide(page: Page) -> None:
    """Lead a touch along the string, and leave it there."""
    string = String(page)
    string.mouse("mousePressed", 0.3)
    time.sleep(1.0)
    for step in range(60):
        string.mouse("mouseMoved", 0.3 + 0.0025 * step)  # ends beside the nodes of low modes
        time.sleep(0.03)


def todays_page() -> str:
    """Return the checksum of what the page shows: its files, and the build that is demonstrated."""
    files = [
        each
        for folder in STATIC
        for each in sorted(folder.iterdir())
        if each.is_file() and "design" not in each.name
    ]
    shown = [*(each.read_bytes() for each in files), json.dumps(dict(UNSEEN)).encode()]
    return sha256(b"".join(shown)).hexdigest()[:16]


def page_of(picture: Path) -> str:
    """Return the checksum of the page that a picture shows; empty where it says none."""
    found = re.search(rb"tEXt" + MARK + rb"\0(\w+)", picture.read_bytes())
    return found[1].decode() if found else ""


def mark(picture: Path, page: str) -> None:
    """Write into a picture which page it shows, as text before its last chunk."""
    content, text = picture.read_bytes(), b"tEXt" + MARK + b"\0" + page.encode()
    chunk = struct.pack(">I", len(text) - 4) + text + struct.pack(">I", zlib.crc32(text))
    picture.write_bytes(content[:-12] + chunk + content[-12:])


def take_the_page() -> None:
    """Take the pictures of the demonstration's page, and mark them."""
    with tempfile.TemporaryDirectory() as folder:
        with demonstration(Path(folder)) as started:
            of_the_page(started.address, Path(folder))
        for name in OF_THE_PAGE:
            mark(Path(folder) / name, todays_page())
            (FIGURES / name).write_bytes((Path(folder) / name).read_bytes())


def take(page: Page, path: Path, *, whole: bool = False) -> None:
    """Take a picture of a page that keeps up and has told what touches; wait for that as long as needed."""
    page.wait(f"!({LATE}) && monochord.moment.decided.contact && monochord.moment.tracked.position?.value")
    page.picture(path, whole=whole)


def of_the_page(address: str, folder: Path) -> None:
    """Take a picture in light down to the spectra, of the whole page in dark, and on a phone."""
    with opened(address) as page:
        page.size(1200, 1060)
        page.scheme("light")
        page.wait(READY)
        time.sleep(SETTLED)  # notes may come and go meanwhile
        history = "document.getElementById('history-title').closest('.card')"
        page.wait(f"!({LATE})")
        page.size(1200, round(page.ask(f"{history}.getBoundingClientRect().top")))
        slide(page)
        take(page, folder / "page_light.png")
        page.scheme("dark")
        time.sleep(0.5)
        take(page, folder / "page_dark.png", whole=True)
        String(page).mouse("mouseReleased", 0.6)
        page.size(360, 930, scale=2.0, mobile=True)
        page.scheme("light")
        page.wait("monochord.moment.truth.contact === 0")
        slide(page)
        take(page, folder / "page_phone.png")


def of_the_design() -> None:
    """Take a picture of the design's sliders and figures in light, and of its charts in dark."""
    with Server([design_page()]) as server, opened(f"{server.address}design#tension=40&gap=2") as page:
        page.size(1200, 900)
        page.scheme("light")
        page.wait("window.monochord?.own && monochord.advice && !monochord.busy ? 1 : 0", PATIENCE)
        bottom = "document.querySelector('[aria-labelledby=advice-title]').getBoundingClientRect().bottom"
        page.size(1200, round(page.ask(bottom)) + 16)
        page.picture(FIGURES / "design_light.png")
        page.scheme("dark")
        page.size(1200, 900)
        page.ask("document.getElementById('charts-title').scrollIntoView()")
        time.sleep(0.5)
        page.picture(FIGURES / "design_dark.png")


def of_the_bring_up() -> None:
    """Take a picture of the bring-up of a simulated sensor in the middle in light, and of its end in dark."""
    with (
        tempfile.TemporaryDirectory() as folder,
        subprocess.Popen(BRING_UP, cwd=folder, stdout=subprocess.PIPE, text=True) as process,
    ):
        assert process.stdout is not None
        with opened(process.stdout.readline().split()[1]) as page:
            page.size(1200, 880)
            page.scheme("light")
            for name in ("quiet", "pluck", "tap", "driver_1", "driver_2", "both", "press", "damped"):
                page.wait(
                    f"window.monochord?.state?.step === '{name}' && monochord.state.phase === 'ready'",
                    PATIENCE,
                )
                page.ask("document.getElementById('record').click()")
                page.wait("monochord.state.phase === 'recording'", PATIENCE)
                if name == "driver_1":
                    time.sleep(3.0)
                    page.picture(FIGURES / "bring_up_light.png")
            page.wait("monochord.state.phase === 'done' && monochord.state.paths.length", PATIENCE)
            page.scheme("dark")
            page.size(1200, 760)
            time.sleep(0.5)
            page.picture(FIGURES / "bring_up_dark.png")
        process.kill()


def pictures_in(printed: str) -> Iterator[list[str]]:
    """Give each picture that a live view draws on a terminal, as lines with their styles."""
    lines: dict[int, str] = {}
    row = 0
    for part in re.finditer(r"\x1b\[(\d+)A|(\n)|([^\r\n]*?)\x1b\[K", printed):
        up, down, line = part.groups()
        if up:
            yield [lines.get(k, "") for k in range(row + 1)]
            row -= int(up)
        elif down:
            row += 1
        else:
            lines[row] = line


def sliding(printed: str) -> list[str]:
    """Return the first picture that is well within a slide."""
    seen = 0
    for lines in pictures_in(printed):
        text = Text.from_ansi("\n".join(lines)).plain
        seen = (
            seen + 1
            if re.search(r"truth, slides [\d.]+ mm/s *$", text, re.MULTILINE)
            and re.search(r"slip +slides", text)
            else 0
        )
        if seen == INTO_A_SLIDE:
            return lines
    raise AssertionError("no slide in this time")


def of_the_terminal() -> None:
    """Take a picture of the live view in a terminal, drawn in a browser's letters."""
    size = {"COLUMNS": str(COLUMNS), "LINES": str(ROWS), "COLORTERM": "truecolor"}
    lines = sliding(on_a_terminal(["--no-browser", "--seconds", "20"], size))
    console = Console(
        record=True, file=StringIO(), width=COLUMNS, force_terminal=True, color_system="truecolor"
    )
    console.print(Text.from_ansi("\n".join(lines)), soft_wrap=True)
    html = console.export_html(theme=DARK, code_format=TERMINAL, inline_styles=True)
    # The font has no Braille: a wider one stands in, one cell for each character.
    html = re.sub("[\u2800-\u28ff]", r"<i><b>\g<0></b></i>", html)
    with opened("data:text/html;base64," + base64.b64encode(html.encode()).decode()) as page:
        page.size(1200, 800, scale=2.0)
        width, height = (
            page.wait("""(() => {const box = document.querySelector('pre')?.getBoundingClientRect();
            return box && [Math.ceil(box.width), Math.ceil(box.height)]})()""")
        )
        page.size(width, height, scale=1.75)
        page.picture(FIGURES / "live.png")


def main() -> None:
    """Take all pictures, or those that are named: page, terminal, design, bring-up."""
    which = sys.argv[1:] or ["page", "terminal", "design", "bring-up"]
    if "design" in which:
        of_the_design()
    if "bring-up" in which:
        of_the_bring_up()
    if "terminal" in which:
        of_the_terminal()
    if "page" in which:
        take_the_page()


if __name__ == "__main__":
    main()
