"""Files of a results folder besides the arrays: strict JSON, and pictures of figures."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from workbench._core.heavy_types import Figure
from workbench.bench.question import plain
from workbench.bench.trust.untrusted import file_stem
from workbench.figures.formats import png, svg


def write_json(file: Path, content: Mapping[str, Any]) -> None:
    """Write strict, readable JSON: a value without nested lists or mappings takes one line."""
    file.write_text(_laid_out(plain(content)) + "\n", encoding="utf-8")


def _laid_out(content: Any, margin: str = "\n") -> str:
    named = content.items() if isinstance(content, Mapping) else ()
    inner = content if isinstance(content, list) else [entry for _, entry in named]
    if not any(isinstance(entry, Mapping | list) for entry in inner):
        return json.dumps(content, allow_nan=False)
    deeper, (start, end) = margin + "  ", "{}" if named else "[]"
    names = [f"{json.dumps(name)}: " for name, _ in named] or [""] * len(inner)
    entries = [name + _laid_out(e, deeper) for name, e in zip(names, inner, strict=True)]
    return f"{start}{deeper}{f',{deeper}'.join(entries)}{margin}{end}"


@dataclass(frozen=True)
class Picture:
    """A figure as PNG and SVG; the same figure gives the same bytes. A notebook shows it."""

    png: bytes
    svg: bytes

    def __repr__(self) -> str:
        return f"<Picture of {len(self.png) // 1000} kB; .save(folder, name) writes it>"

    def _repr_png_(self) -> bytes:
        return self.png

    def save(self, folder: str | Path, name: str) -> list[Path]:
        """Write ``name.svg`` and ``name.png`` into a folder; a missing folder is made."""
        place = Path(folder)
        file_stem(name)
        place.mkdir(parents=True, exist_ok=True)
        files = [place / f"{name}.svg", place / f"{name}.png"]
        for file, content in zip(files, (self.svg, self.png), strict=True):
            file.write_bytes(content)
        return files


def picture(figure: Figure) -> Picture:
    """A figure as PNG and SVG."""
    return Picture(png(figure), svg(figure))
