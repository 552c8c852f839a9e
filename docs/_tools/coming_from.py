"""Tables of the pages "Coming from", made from `workbench/_core/coming_from/*.toml`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from gallery import write_page

from workbench._core.coming_from import Guide, Row, guides

PAGES = Path(__file__).parents[1] / "coming-from"
BEGIN, END = (
    "<!-- made from workbench/_core/coming_from/{}.toml by make docs -->",
    "<!-- end of what is made -->",
)
HEAD = "| {} | workbench | a line that runs | remark |\n| --- | --- | --- | --- |"


def filled(text: str, guide: Guide) -> str:
    """The text of a page with the table of its guide between the two marks."""
    begin = BEGIN.format(guide.page)
    lines = [
        begin,
        "The lines of the table stand on these:",
        f"```python\n{guide.setup}\n```",
        "\n".join([HEAD.format(guide.tool), *map(_table_row, guide.rows)]),
        END,
    ]
    pattern = re.escape(begin) + ".*?" + re.escape(END)
    return re.sub(pattern, lambda _: "\n\n".join(lines), text, count=1, flags=re.DOTALL)


def _table_row(row: Row) -> str:
    names = ", ".join(f"`{name}`" for name in row.names)
    # What is called by one name is shown with its arguments; other words are no code.
    told = f"`{row.call}`" if row.call and "(" in row.call else row.call or names
    here = ", ".join(f"`{one}`" for one in row.here) or "–"
    return f"| {told} | {here} | `{row.line}` | {row.remark} |"


def make(app: Any = None) -> None:
    """Write the tables anew."""
    for guide in guides():
        page = PAGES / f"{guide.page}.md"
        write_page(page, filled(page.read_text(encoding="utf-8"), guide))


def setup(app: Any) -> dict[str, bool]:
    app.connect("builder-inited", make)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


if __name__ == "__main__":
    make()
