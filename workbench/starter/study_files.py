"""The files of a study: written from templates, with weights that a tried controller meets."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol, TypeVar

TEMPLATES = {
    "pyproject.toml": "pyproject.toml.jinja",
    "README.md": "README.md.jinja",
    "problems/{package}/__init__.py": "package.py.jinja",
    "problems/{package}/design.py": "design.py.jinja",
    "tests/test_{package}.py": "test.py.jinja",
    "notebooks/{package}.ipynb": "notebook.py.jinja",
}
"""Files of a study, and the template of each file."""


class Choices(Protocol):
    """Initial numbers of a design."""

    @property
    def reasons(self) -> Mapping[str, str]:
        """Why each number is what it is."""


Chosen = TypeVar("Chosen", bound=Choices)


def write_files(
    target: Path,
    paths: list[Path],
    told: dict[str, Any],
    chosen: Chosen,
    kept: Callable[[Path], Chosen],
    templates: Mapping[str, str] = TEMPLATES,
) -> Chosen:
    """Write the study with weights that a tried controller meets; it appears whole or not at
    all.

    `kept` tries a controller with the file of the design, and returns such weights.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}-") as place:
        made = Path(place) / target.name
        _write(made, paths, told, chosen, templates)
        chosen = kept(made / "problems" / str(told["package"]) / "design.py")
        _write(made, paths, told, chosen, templates)
        made.rename(target)
    return chosen


def _write(
    folder: Path,
    paths: list[Path],
    told: dict[str, Any],
    chosen: Choices,
    templates: Mapping[str, str],
) -> None:
    """Write every file of the study into a folder."""
    import jinja2

    told = told | {"chosen": chosen, "reasons": chosen.reasons}
    made = jinja2.Environment(
        loader=jinja2.PackageLoader("workbench.starter"),
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    package = str(told["package"])
    for name, template in templates.items():
        file = folder / name.format(package=package)
        file.parent.mkdir(parents=True, exist_ok=True)
        text = made.get_template(template).render(told)
        file.write_text(_notebook(text) if file.suffix == ".ipynb" else text, encoding="utf-8")
    data = folder / "problems" / package / "data"
    data.mkdir(exist_ok=True)
    for path in paths:
        shutil.copyfile(path, data / path.name)


def _notebook(text: str) -> str:
    """A notebook whose cells begin at lines `# %%`.

    Cells that begin at `# %% [markdown]` are prose.
    """
    cells: list[dict[str, Any]] = []
    for part in text.split("# %%")[1:]:
        head, _, body = part.partition("\n")
        body = body.strip("\n")
        number: dict[str, Any] = {"id": f"cell{len(cells)}", "metadata": {}}
        if "[markdown]" in head:
            prose = "\n".join(line.removeprefix("# ") for line in body.splitlines())
            cells.append({"cell_type": "markdown", "source": prose} | number)
        else:
            cells.append(
                {"cell_type": "code", "source": body, "execution_count": None, "outputs": []}
                | number
            )
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return json.dumps(
        {
            "cells": cells,
            "metadata": {"kernelspec": kernel},
            "nbformat": 4,
            "nbformat_minor": 5,
        },
        indent=1,
    )
