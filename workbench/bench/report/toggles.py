"""Figures whose parts belong to methods, as SVG in a page where a script shows or hides them.

Everything that a figure draws for a method has the id ``method:NAME`` (matplotlib's ``gid``). Such
a figure is stored as SVG. When a page is made, the SVG is rewritten: only drawing elements remain,
ids get a prefix of the figure, and the parts of methods are marked with ``data-method``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

from markupsafe import Markup

from workbench._core.heavy_types import Figure
from workbench.bench.comparison.styles import GID

_SPACE = "{http://www.w3.org/2000/svg}"
_LINK = "{http://www.w3.org/1999/xlink}href"
_TAGS = {"svg", "g", "defs", "path", "use", "clipPath", "rect", "title", "image"}
_ATTRIBUTES = {"d", "transform", "style", "x", "y", "width", "height", "viewBox", "clip-path"}
_FOREIGN = re.compile(r"url\((?!#)|expression|@import|\\", re.IGNORECASE)

Told = tuple[str, Sequence[str]]
"""Id of a part of a figure, and one sentence for each of its markers."""


@dataclass(frozen=True)
class Toggled:
    """A figure to put into a page, and the methods that it draws, in drawing order."""

    markup: Markup
    methods: tuple[str, ...]


def has_methods(figure: Figure) -> bool:
    """Whether parts of a figure belong to methods."""
    return bool(figure.findobj(lambda artist: str(artist.get_gid() or "").startswith(GID)))


def telling(source: bytes, told: Sequence[Told]) -> bytes:
    """A figure as SVG whose markers show a text when they are pointed at.

    Parameters
    ----------
    source
        The figure (`workbench.figures.formats.svg`).
    told
        The texts of its markers, part by part in drawing order. A part without an entry shows the
        name of its method.
    """
    root = ElementTree.fromstring(source)
    _tell(root, told)
    return ElementTree.tostring(root, encoding="utf-8")


def _tell(root: ElementTree.Element, told: Sequence[Told]) -> None:
    """Attach a text to every marker of the parts."""
    waiting = list(told)
    for part in root.iter(f"{_SPACE}g"):
        if not waiting or part.get("id") != waiting[0][0]:
            continue
        markers = [use for use in part.iter(f"{_SPACE}use") if use.get("x") is not None]
        for marker, sentence in zip(markers, waiting.pop(0)[1], strict=True):
            ElementTree.SubElement(marker, f"{_SPACE}title").text = sentence


def toggled(source: bytes, prefix: str) -> Toggled:
    """A stored SVG as a page contains it: drawing elements only, ids with the given prefix.

    Raises
    ------
    ValueError
        The source is not an SVG.
    """
    try:
        root = ElementTree.fromstring(source)
    except ElementTree.ParseError as error:
        raise ValueError(f"no SVG: {error}") from None
    if root.tag != f"{_SPACE}svg":
        raise ValueError(f"no SVG: its root is {root.tag}")
    methods: dict[str, None] = {}
    clean = _drawing(root, prefix, methods)
    for size in ("width", "height"):
        clean.attrib.pop(size, None)  # as wide as the page allows
    markup = Markup(ElementTree.tostring(clean, encoding="unicode", method="xml"))
    return Toggled(markup, tuple(methods))


def _drawing(
    node: ElementTree.Element, prefix: str, methods: dict[str, None]
) -> ElementTree.Element:
    """A copy of an element with drawing elements only.

    Nothing that runs, loads or styles the page.
    """
    clean = ElementTree.Element(node.tag.removeprefix(_SPACE))
    name = node.get("id", "")
    if name.startswith(GID):
        method = name.removeprefix(GID)
        methods[method] = None
        clean.set("data-method", method)
    elif name:
        clean.set("id", prefix + name)
    for attribute, value in node.attrib.items():
        if attribute in _ATTRIBUTES and not _FOREIGN.search(value):
            clean.set(attribute, value.replace("url(#", f"url(#{prefix}"))
    target = node.get(_LINK, node.get("href", ""))
    if target.startswith("#"):
        clean.set("href", f"#{prefix}{target[1:]}")
    elif target.startswith("data:image/png;base64,"):
        clean.set("href", target)
    if clean.tag == "title":
        clean.text = node.text
    for child in node:
        if child.tag.removeprefix(_SPACE) in _TAGS:
            clean.append(_drawing(child, prefix, methods))
    return clean
