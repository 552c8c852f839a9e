"""The pages "Coming from" show the table that answers whoever types a name of another tool."""

import sys
from pathlib import Path

import pytest

from workbench._core.coming_from import guides

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture
def tool(monkeypatch):
    monkeypatch.syspath_prepend(DOCS / "_tools")
    import coming_from

    yield coming_from
    for name in ("coming_from", "gallery"):
        sys.modules.pop(name, None)


@pytest.mark.parametrize("guide", guides(), ids=lambda guide: guide.page)
def test_a_page_shows_its_table(tool, guide):
    text = (tool.PAGES / f"{guide.page}.md").read_text(encoding="utf-8")
    assert tool.BEGIN.format(guide.page) in text and tool.END in text
    assert tool.filled(text, guide) == text, "write it anew: python docs/_tools/coming_from.py"


def test_a_page_has_a_guide(tool):
    by_hand = {"index", "documented-examples"}
    assert {page.stem for page in tool.PAGES.glob("*.md")} - by_hand == {g.page for g in guides()}
