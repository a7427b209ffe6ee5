"""Rows of features in one file, and a page of them for people beside it."""

from pathlib import Path

from monochord.evaluation.paper_page import paper_page
from monochord.evaluation.paper_rows import Row, keep_rows


def keep(file: Path, rows: list[Row]) -> None:
    """Put rows into FILE.json in place of those of the same feature, and write FILE.md from all in it."""
    kept = keep_rows(file, rows)
    file.with_suffix(".md").write_text(paper_page(kept), encoding="utf-8")
