"""Outputs of cells without a word, such as a progress bar that has gone, are left out of a page."""

from __future__ import annotations

from typing import Any

from docutils import nodes


def drop_empty(app: Any, doctree: nodes.document) -> None:
    """Remove blocks of blanks."""
    for block in list(doctree.findall(nodes.literal_block)):
        if not block.astext().strip():
            block.parent.remove(block)


def setup(app: Any) -> dict[str, bool]:
    """Connect before pages are written."""
    app.connect("doctree-read", drop_empty)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
