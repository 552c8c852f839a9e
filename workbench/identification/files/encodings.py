"""The text of a file in any usual encoding."""

from __future__ import annotations

import codecs
from pathlib import Path

from workbench.errors import InputError

MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF32_LE: "utf-32",
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
"""Encodings by their byte-order marks; the mark of UTF-32 begins with that of UTF-16."""
OTHER_FORMATS = {
    b"\x1f\x8b": "is compressed: unpack it",
    b"PK\x03\x04": "is an archive: unpack it, or name it .xlsx if it is a workbook",
    b"\xd0\xcf\x11\xe0": "is a workbook of old Excel: save it as .xlsx or .csv",
    b"\x89HDF": "is HDF5: name it .mat or .nc, which it may be, or write its columns as text",
    b"PAR1": "is Parquet: write its columns as text",
    b"MATLAB 5": "is a MAT file: name it .mat",
    b"MATLAB 7": "is a MAT file: name it .mat",
    b"%PDF": "is a PDF: save its table as text",
}
"""First bytes of files that are not text, and advice for each."""
SAMPLE = 1000
"""Number of bytes by which UTF-16 without a mark is recognised."""
SIGNS = str.maketrans({"\u2212": "-", "\u2012": "-", "\u2013": "-", "\u00a0": " ", "\u202f": " "})
"""Typographic signs, and the plain ones that numbers use."""


def decoded(path: Path) -> str:
    """Text of a file in UTF-8, UTF-16, UTF-32, or as Windows writes it, with plain signs.

    Raises InputError for a file that is not text; the message names its format, if that is
    recognised.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    for first, what in OTHER_FORMATS.items():
        if raw.startswith(first):
            raise InputError(f"{path} {what}")
    marked = next((name for mark, name in MARKS.items() if raw.startswith(mark)), None)
    try:
        text = raw.decode(marked or _without_mark(raw))
    except UnicodeDecodeError:
        text = raw.decode(marked or "cp1252", errors="replace")
    text = text.rstrip("\x00\x1a")  # left behind by a logger whose supply failed, and by old DOS
    if "\x00" in text:
        raise InputError(f"{path} is no text; .mat, .nc and .xlsx files must be named so")
    return text if text.isascii() else text.translate(SIGNS)


def _without_mark(raw: bytes) -> str:
    """UTF-16 has a zero in every other byte, since digits and separators need one byte only."""
    head = raw[:SAMPLE]
    for first, name in ((1, "utf-16-le"), (0, "utf-16-be")):
        high, low = head[first::2], head[1 - first :: 2]
        if high and 2 * high.count(0) > len(high) and not low.count(0):
            return name
    return "utf-8"
