"""Tables and code in Markdown, converted to HTML with captions and scopes."""

from __future__ import annotations

import re

from markupsafe import Markup, escape

FENCE = "```"
"""The mark at the beginning of the lines above and below a block of code."""
LONGEST_CAPTION = 90
"""Most characters of a line above a table that becomes its caption; a longer line is a
paragraph.
"""
LONGEST_CELL = 32
"""Most characters of a cell in one line; a longer text is broken, so that the table is narrower."""


def tables_as_html(markdown: str, name: str) -> Markup:
    """The pipe tables and fenced code of a Markdown text as HTML, other lines as paragraphs.

    Every table has a caption: the name, and a short line above it if there is one. So has code,
    which keeps its lines and spaces.
    """
    html = Markup("")
    for place, part in enumerate(re.split(rf"^{FENCE}.*\n?", markdown, flags=re.MULTILINE)):
        if place % 2:
            html += Markup(
                '<p class="caption">{}</p><pre tabindex="0"><code>{}</code></pre>'
            ).format(name, part)
        else:
            html += _tables_and_paragraphs(part, name)
    return html


def _tables_and_paragraphs(markdown: str, name: str) -> Markup:
    """A part of a text without code blocks, as HTML."""
    html, rows, line_above = Markup(""), list[list[str]](), ""
    for line in [*markdown.splitlines(), ""]:
        if line.startswith("|"):
            rows.append([cell.strip() for cell in line.strip().strip("|").split("|")])
            continue
        if rows:
            caption = f"{name}: {line_above}" if line_above else name
            html += _table(rows, caption)
            rows, line_above = [], ""
        if not line:
            continue
        if line_above:
            html += Markup("<p>{}</p>").format(_spans(line_above))
        line_above = line if len(line) <= LONGEST_CAPTION else ""
        if not line_above:
            html += Markup("<p>{}</p>").format(_spans(line))
    return html + (Markup("<p>{}</p>").format(_spans(line_above)) if line_above else Markup(""))


def _spans(text: str) -> Markup:
    """A text with back-quoted parts as code."""
    parts = re.split(r"`([^`]+)`", text)
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if place % 2 else escape(part)
        for place, part in enumerate(parts)
    )


def _table(rows: list[list[str]], caption: str) -> Markup:
    """A table; its first column holds the row heads, unless that is a column of numbers.

    If it has long texts, a narrow page folds its rows: each cell then names its column.
    """
    if len(rows) < 2 or len({len(row) for row in rows}) > 1:  # a cell contains a bar
        text = "\n".join(" | ".join(row) for row in rows)
        return Markup("<p>{}</p><pre>{}</pre>").format(_spans(caption), text)
    head, rule, *body = rows
    numeric = [mark.endswith(":") for mark in rule]
    cells = [pair for row in body for pair in zip(row, numeric, strict=True)]
    folds = any(len(text) > LONGEST_CELL and not right for text, right in cells)

    def cell(text: str, right: bool, tag: str, scope: str = "", label: str = "") -> Markup:
        looks = "num" if right else "long" if len(text) > LONGEST_CELL else ""
        named = {"scope": scope, "class": looks, "data-label": label if folds else ""}
        attributes = Markup("").join(
            Markup(' {}="{}"').format(name, value) for name, value in named.items() if value
        )
        start = Markup("<{}{}>").format(Markup(tag), attributes)
        return start + _spans(text) + Markup("</{}>").format(Markup(tag))

    heads = Markup("").join(
        cell(text, right, "th", "col") for text, right in zip(head, numeric, strict=True)
    )
    lines = Markup("")
    for row in body:
        line = [
            cell(text, right, "th", "row")
            if not place and not right
            else cell(text, right, "td", label=name)
            for place, (text, right, name) in enumerate(zip(row, numeric, head, strict=True))
        ]
        method = (
            Markup(' data-method="{}"').format(_method(head, row)) if _method(head, row) else ""
        )
        lines += Markup("<tr{}>{}</tr>").format(method, Markup("").join(line))
    return Markup(
        "<table{}><caption>{}</caption><thead><tr>{}</tr></thead><tbody>{}</tbody></table>"
    ).format(Markup(' class="folds"') if folds else "", _spans(caption), heads, lines)


def _method(head: list[str], row: list[str]) -> str:
    """The method of a row, if the table has a column of methods."""
    return row[head.index("method")] if "method" in head else ""
