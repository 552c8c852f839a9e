"""Run the notebooks of the course, keep small outputs, and detect outdated ones.

``make notebooks`` calls ``python -m workbench.course.execution`` to renew the outputs. A solution
is a Markdown cell tagged "solution": its text and code stand in an HTML element that the reader
opens, and tests run the code.
"""

from __future__ import annotations

import base64
import hashlib
import io
import math
import os
import re
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

SOLUTION, VARIES = "solution", "varies"
"""Tags of cells: for a solution, which stays hidden until the reader opens it; and for outputs that
vary from run to run.
"""
COLOURS, WIDEST = 32, 900
"""Number of colours of a stored picture, enough for curves with smooth edges; and its largest width
[pixel].
"""
LONGEST_CELL = 600.0
"""Seconds after which a cell is stopped."""
NUMBER_TOLERANCE = 0.02
"""Relative difference between a printed number and the stored one that is allowed, since machines
differ.
"""

_PYTHON = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_DIGEST = "sources"


def tagged(cell: Any, tag: str) -> bool:
    """Whether a cell has this tag."""
    return tag in cell.metadata.get("tags", ())


def code_of_solutions(notebook: Any) -> list[str]:
    """The Python code of the solutions, one text for each block."""
    return [
        block
        for cell in notebook.cells
        if cell.cell_type == "markdown" and tagged(cell, SOLUTION)
        for block in _PYTHON.findall(cell.source)
    ]


def sources_digest(notebook: Any) -> str:
    """A digest of all code cells; stored outputs with another digest are outdated."""
    sources = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    return hashlib.sha256("\0".join(sources).encode()).hexdigest()[:16]


def stale(notebook: Any) -> bool:
    """Whether outputs are missing, or belong to an earlier version of the code."""
    return bool(notebook.metadata.get("workbench", {}).get(_DIGEST) != sources_digest(notebook))


def executed(notebook: Any, folder: Path, *, solutions: bool = False) -> Any:
    """A copy of a notebook, run in a folder; ``solutions`` adds the code of its solutions as cells.

    Results of problems are stored in ``WORKBENCH_RESULTS`` if that is set, otherwise below the
    folder.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        A cell fails.
    """
    from nbclient import NotebookClient

    nbformat = _nbformat()
    ours = nbformat.from_dict(notebook)
    for cell in ours.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
    if solutions:
        ours.cells += [nbformat.v4.new_code_cell(code) for code in code_of_solutions(ours)]
    where = {"metadata": {"path": str(folder)}}
    NotebookClient(ours, timeout=LONGEST_CELL, kernel_name="python3", resources=where).execute()
    return ours


def keep_small(notebook: Any) -> Any:
    """The given notebook, its outputs reduced to what a repository stores, with its digest added.

    Pictures are reduced to few colours; progress bars, warnings and execution times are removed.
    """
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        if cell.cell_type != "code":
            continue
        cell.outputs = _join_printed(
            [_without_clutter(one) for one in cell.outputs if _worth_keeping(one)]
        )
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
        "workbench": {_DIGEST: sources_digest(notebook)},
    }
    return notebook


def _nbformat() -> Any:
    """Import nbformat, which has no type annotations and is installed with the extra "test"."""
    import nbformat

    return nbformat


def _worth_keeping(output: Any) -> bool:
    if output.output_type == "stream":
        return bool(output.name == "stdout")
    return output.output_type != "display_data" or "image/png" in output.data


def _join_printed(outputs: list[Any]) -> list[Any]:
    """Outputs in which texts printed in several portions are joined into one."""
    joined: list[Any] = []
    for output in outputs:
        if joined and output.output_type == "stream" == joined[-1].output_type:
            joined[-1].text += output.text
        else:
            joined.append(output)
    return joined


def _without_clutter(output: Any) -> Any:
    if "image/png" in output.get("data", {}):
        pixels = base64.b64decode(output.data["image/png"])
        output.data = {"image/png": base64.b64encode(few_colours(pixels)).decode()}
    output.get("metadata", {}).clear()
    return output


def few_colours(png: bytes) -> bytes:
    """A picture with a palette of `COLOURS`, no wider than `WIDEST`."""
    from PIL import Image

    file = io.BytesIO()
    with Image.open(io.BytesIO(png)) as picture:
        coloured = picture.convert("RGB")
        coloured.thumbnail((WIDEST, coloured.height))
        coloured.quantize(COLOURS).save(file, format="PNG", optimize=True)
    return file.getvalue()


def output_differences(kept: Any, made: Any) -> list[str]:
    """Differences between two runs of a notebook, a line for each cell.

    Of pictures only the number is compared.

    Numbers may differ by `NUMBER_TOLERANCE`; cells tagged "varies" are skipped.
    """
    found = []
    pairs = zip(kept.cells, made.cells, strict=False)  # solutions come after the reader's cells
    for number, (old, new) in enumerate(pairs, start=1):
        if old.cell_type != "code" or tagged(old, VARIES):
            continue
        before, after = _text_of_outputs(old), _text_of_outputs(new)
        if not _same_but_numbers(before, after):
            found.append(f"cell {number} said\n{before}\nand says\n{after}")
    return found


def _text_of_outputs(cell: Any) -> str:
    """All text of a cell's outputs, and one word for every picture."""
    parts = []
    for output in _join_printed([one for one in cell.outputs if _worth_keeping(one)]):
        data = output.get("data", {})
        if "image/png" in data:
            parts.append("[picture]")
        else:
            parts.append(output.get("text", "") or data.get("text/plain", ""))
    return "\n".join(part.strip() for part in parts)


def _same_but_numbers(before: str, after: str) -> bool:
    if _NUMBER.split(before) != _NUMBER.split(after):
        return False
    pairs = zip(_NUMBER.findall(before), _NUMBER.findall(after), strict=True)
    return all(
        math.isclose(float(old), float(new), rel_tol=NUMBER_TOLERANCE, abs_tol=1e-9)
        for old, new in pairs
    )


def remake(file: Path) -> float:
    """Run a notebook in an empty folder and write its outputs into the file; the time taken [s]."""
    nbformat = _nbformat()
    notebook = nbformat.read(file, as_version=4)
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["WORKBENCH_RESULTS"] = str(Path(folder, "results"))
        made = keep_small(executed(notebook, Path(folder)))
    seconds = time.perf_counter() - start
    nbformat.write(made, file)
    return seconds


if __name__ == "__main__":
    for name in sys.argv[1:]:
        took = remake(Path(name))
        size = Path(name).stat().st_size / 1000
        print(f"{name}: {took:.0f} s, {size:.0f} kB", flush=True)
