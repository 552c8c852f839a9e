"""Small pictures of figures."""

from __future__ import annotations

import io
import struct

THUMBNAIL = (240, 180)
"""Largest width and height [pixel]; shown at half that size, so it is sharp on fine screens too."""
COLOURS = 48


def thumbnail(png: bytes) -> bytes:
    """A small picture of a figure, from PNG to PNG; the same figure gives the same bytes."""
    from PIL import Image

    with Image.open(io.BytesIO(png)) as figure:
        small = Image.new("RGB", figure.size, "white")
        small.paste(figure, mask=figure.getchannel("A") if figure.mode == "RGBA" else None)
    small.thumbnail(THUMBNAIL, Image.Resampling.LANCZOS)
    file = io.BytesIO()
    small.quantize(COLOURS).save(file, "PNG", optimize=True)
    return file.getvalue()


def pixels_of(png: bytes) -> tuple[int, int]:
    """Width and height of a PNG [pixel]; a page reserves the space before the figure is loaded."""
    width, height = struct.unpack(">II", png[16:24])
    return width, height
