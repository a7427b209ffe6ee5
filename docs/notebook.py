"""The notebook of a tutorial, made from its page: text, commands, programs and pictures become its cells."""

import re
from pathlib import Path

import jupytext  # pyright: ignore[reportMissingImports]
import nbformat

KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}
HEAD = (
    "---\njupyter:\n  kernelspec:\n"
    + "".join(f"    {key}: {value}\n" for key, value in KERNEL.items())
    + "---\n"
)
"""What tells jupytext that programs are Python's, and commands are the shell's."""
PICTURE = re.compile(r"--figure (\S+\.png)")
"""A picture that a command draws into a file."""
REPORT = re.compile(r"^monochord evaluate .*--out (\S+)", re.MULTILINE)
"""The folder of a report, whose page has figures."""
SHOW_PICTURE = """from IPython.display import Image

Image("{}")"""
SHOW_REPORT = """from html import escape
from pathlib import Path

from IPython.display import HTML

report = escape(Path("{}/report.html").read_text())
HTML(f\'<iframe srcdoc="{{report}}" width="100%" height="600"></iframe>\')"""
"""A page within the notebook, in a frame, so that its style stays its own."""


def write(page: Path) -> None:
    """Write the notebook of a page beside it; one that would not change is left alone.

    A command becomes a cell of the shell, a program one of Python, and what a command draws, a picture or a
    report, is shown below it. Identifiers are the cells' numbers, so that equal pages give equal notebooks.
    """
    notebook = jupytext.reads(HEAD + page.read_text(encoding="utf-8"), fmt="md")
    notebook.cells = [shown for cell in notebook.cells for shown in (cell, *pictures(cell.source))]
    for number, cell in enumerate(notebook.cells):
        cell.id = str(number)
    notebook.metadata = nbformat.from_dict({"kernelspec": KERNEL})
    path, text = page.with_suffix(".ipynb"), nbformat.writes(notebook) + "\n"
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def pictures(source: str) -> list[nbformat.NotebookNode]:
    """Return the cells that show the pictures and reports of a cell's commands."""
    shows = [SHOW_PICTURE.format(name) for name in PICTURE.findall(source)]
    shows += [SHOW_REPORT.format(folder) for folder in REPORT.findall(source)]
    return [nbformat.v4.new_code_cell(text) for text in shows]
