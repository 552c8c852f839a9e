"""Semidefinite programs in SDPA's sparse format (``.dat-s``), such as those of SDPLIB."""

from __future__ import annotations

import re
from os import PathLike

import numpy as np

from workbench.certify.cones.form import ConeFactor, ConeKind
from workbench.collections.lines import Entries, Lines
from workbench.conic import ConicProgram


def read_sdpa(file: str | PathLike[str]) -> ConicProgram:
    r"""Read the program  minimise c'x  subject to  x_1 F_1 + ... + x_m F_m - F_0 >= 0.

    The matrices are block diagonal; a block of negative size is a diagonal matrix. An entry below
    the diagonal counts as the one above; each entry may be given once.

    Parameters
    ----------
    file
        A file in the sparse format of SDPA (K. Fujisawa, M. Kojima, K. Nakata, M. Yamashita,
        SDPA user's manual, section 5).

    Returns
    -------
    ConicProgram
        A cone for each block, in the file's order; ``x`` are the m variables.

    Raises
    ------
    InputError
        The file is missing or malformed; the message names the line.

    Examples
    --------
    >>> from pathlib import Path
    >>> import workbench as wb
    >>> from workbench.collections import read_sdpa
    >>> file = Path("largest_eigenvalue.dat-s")  # the least t with t I >= diag(1, 2)
    >>> lines = ["1", "1", "2", "1.0", "0 1 1 1 1.0", "0 1 2 2 2.0", "1 1 1 1 1.0", "1 1 2 2 1.0"]
    >>> _ = file.write_text("\n".join(lines))
    >>> round(wb.solve(read_sdpa(file), method="clarabel").metrics["value"], 5)
    2.0
    """
    lines = Lines(file, '"*')
    count = lines.whole(_cells(lines.needed("the number of variables"))[0], "m", 1)
    blocks = lines.whole(_cells(lines.needed("the number of blocks"))[0], "nblocks", 1)
    sizes = _sizes(lines, _cells(lines.needed("the sizes of the blocks")), blocks)
    c = [lines.real(cell, "c") for cell in _cells(lines.needed("the objective"))]
    if len(c) != count:
        raise lines.error(f"the objective has {len(c)} entries, {count} are needed")
    cones = [
        ConeFactor(ConeKind.SEMIDEFINITE if size > 0 else ConeKind.NONNEGATIVE, abs(size))
        for size in sizes
    ]
    starts = np.cumsum([0, *(cone.rows for cone in cones)])
    entries = Entries(lines)
    while (text := lines.following()) is not None:
        cells = _cells(text)
        if len(cells) != 5:
            raise lines.error(f"{len(cells)} numbers; needed are matrix, block, i, j and value")
        matrix = lines.whole(cells[0], "the matrix")
        if matrix > count:
            raise lines.error(f"matrix {matrix} of {count} variables")
        block = lines.place(cells[1], blocks, "the block", 1)
        places = [lines.place(cells[k], cones[block].size, "ij"[k - 2], 1) for k in (2, 3)]
        i, j = sorted(places)
        value = lines.real(cells[4], "the value")
        if cones[block].kind is ConeKind.NONNEGATIVE:
            if i != j:
                raise lines.error(f"block {block + 1} is diagonal, the entry ({i + 1}, {j + 1})")
            row = starts[block] + i
        else:
            row = starts[block] + j * (j + 1) // 2 + i
        if matrix == 0:
            entries.put(int(row), None, -value)
        else:
            entries.put(int(row), matrix - 1, value)
    return ConicProgram(entries.form(np.array(c), cones))


def _cells(text: str) -> list[str]:
    """Numbers of a line, separated by spaces, commas, braces or brackets."""
    return re.sub(r"[,(){}=]", " ", text).split()


def _sizes(lines: Lines, cells: list[str], blocks: int) -> list[int]:
    """Sizes of the blocks; the rest of the line is a comment."""
    found = []
    for cell in cells[:blocks]:
        try:
            found.append(int(cell))
        except ValueError:
            raise lines.error(f"the size of a block must be a whole number, not {cell!r}") from None
    if len(found) < blocks or 0 in found:
        raise lines.error(f"{blocks} sizes of blocks are needed, none of them 0, not {found}")
    return found
