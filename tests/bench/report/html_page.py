"""A page read by an HTML parser: its elements, its text, and whether they nest."""

from __future__ import annotations

from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

Make = Callable[..., Path]
"""Writes a results folder."""

VOID = {"meta", "img", "input", "br", "wbr", "link", "hr"}
APART = {"script", "style"}


class Page(HTMLParser):
    """Elements of a page with their attributes, and its text, scripts and styles apart.

    ``captions`` has the caption of every table, empty where it has none.
    """

    def __init__(self, page: Path | str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.text = ""
        self.raw: dict[str, list[str]] = {name: [] for name in APART}
        self.captions: list[str] = []
        self._open: list[str] = []
        self.feed(page if isinstance(page, str) else page.read_text(encoding="utf-8"))
        assert not self._open, f"never closed: {self._open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if tag == "table":
            self.captions.append("")
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))

    def handle_data(self, data: str) -> None:
        here = self._open[-1] if self._open else ""
        if here in APART:
            self.raw[here].append(data)
            return
        self.text += data
        if "caption" in self._open:
            self.captions[-1] += data

    def handle_endtag(self, tag: str) -> None:
        assert self._open and self._open[-1] == tag, f"</{tag}> closes {self._open}"
        self._open.pop()

    def all(self, tag: str, cls: str = "") -> list[dict[str, str]]:
        """Attributes of the elements of a kind, and of a class."""
        return [
            attributes
            for name, attributes in self.elements
            if name == tag and cls in ["", *attributes.get("class", "").split()]
        ]

    @property
    def rows(self) -> list[dict[str, str]]:
        """The rows of runs in the index."""
        return self.all("tr", "run")


def run_pages(entry: Path) -> list[Path]:
    """The pages of the runs of a report."""
    return sorted((entry.parent / "report" / "runs").glob("*.html"))


def words_of(entry: Path) -> str:
    """The texts of all pages of a report."""
    return "\n".join(Page(page).text for page in [entry, *run_pages(entry)])
