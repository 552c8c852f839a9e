"""The gallery: a page for each group of named problems, made from the reference results."""

from __future__ import annotations

import shutil
from collections import defaultdict
from pathlib import Path
from typing import Any

import workbench as wb
from workbench.bench.project import registry
from workbench.bench.results import Run
from workbench.bench.verify import finished_folders
from workbench.figures.formats import png

ROOT = Path(__file__).parents[2]
REFERENCE = ROOT / "results" / "reference"
GROUPS = {
    "cd": "CD drive, both axes",
    "cd/focus": "CD drive, focus loop",
    "cd/radial": "CD drive, radial loop",
    "cd-arm": "CD-player arm",
    "mass-spring": "Two masses and a spring",
    "distillation": "Distillation column",
    "unstable-first-order": "Unstable first-order plant",
    "two-by-two": "Two channels",
    "textbook": "Textbook",
    "quick": "Small problems of every kind",
    "bench": "The workbench against its peers",
}
"""Title of each group, in the order of the page."""


def stored() -> dict[str, Run]:
    """The reference run of each problem that has one; of several, that nearest to its defaults."""
    runs = [wb.open_run(folder) for folder in finished_folders(REFERENCE)]
    runs.sort(key=lambda run: (defaults_met(run), run.key))
    return {run.problem: run for run in runs}


def defaults_met(run: Run) -> int:
    """How many parameters of a run are those that its problem has by itself."""
    if run.problem not in registry().entries:
        return 0
    known = registry().find(run.problem).parameters
    given = run.info["parameters"]
    return sum(one.default == given.get(name) for name, one in known.items())


def drawn(run: Run, images: Path) -> Path | None:
    """The figure that people look at, as a PNG; None where the task draws none."""
    file = images / f"{run.problem.replace('/', '-')}-{run.key}.png"
    if not file.exists():
        drawings = run.answered.drawings(run.answer)
        if not drawings:
            return None
        figure = next(iter(next(iter(drawings.values()))().values()))
        file.write_bytes(png(figure))
    return file


def section(entry: Any, run: Run | None, images: Path, used: set[Path]) -> list[str]:
    """Heading, question, figure, numbers and command of a problem."""
    slow = "\n\nMarked slow: `workbench run` takes it by its full name only." if entry.slow else ""
    lines = [f"## `{entry.name}`", f"{entry.summary}{slow}"]
    if run is None:
        lines.append("No stored result yet: the command computes it.")
    else:
        if (file := drawn(run, images)) is not None:
            used.add(file)
            text = f"Figure of {entry.name}"
            lines.append(
                f"```{{image}} ../_build/gallery/{file.name}\n:alt: {text}\n:width: 640px\n```"
            )
        certificate = run.certificate
        checks = len(certificate.checks) if certificate else 0
        verdict = "holds" if run.holds else "does not hold"
        words = [
            f"**{run.headline}**" if run.headline != "-" else "",
            f"certificate {verdict} ({checks} checks)",
        ]
        words.append(f"method `{run.method}`" if run.method else "study")
        lines.append(" · ".join(filter(None, words)))
    lines.append(f"```sh\nworkbench run {entry.name}\n```")
    return lines


def make(app: Any) -> None:
    """Write the pages of the gallery; pictures are kept from one build to the next."""
    pages = Path(app.srcdir) / "gallery"
    images = Path(app.srcdir) / "_build" / "gallery"
    images.mkdir(parents=True, exist_ok=True)
    pages.mkdir(exist_ok=True)
    runs, used = stored(), set()
    groups = defaultdict(list)
    for entry in registry().entries.values():
        groups[entry.name.rpartition("/")[0].removesuffix("/")].append(entry)
    places = {}
    for group, entries in groups.items():
        top = group if group in GROUPS else group.partition("/")[0]
        places.setdefault(top, []).extend(entries)
    for group, entries in places.items():
        lines = [f"# {GROUPS[group]}"]
        for entry in sorted(entries, key=lambda one: one.name):
            lines += section(entry, runs.get(entry.name), images, used)
        write_page(pages / f"{group.replace('/', '-')}.md", "\n\n".join(lines) + "\n")
    for file in set(images.glob("*.png")) - used:
        file.unlink()
    cards = [_card(group, places[group], runs, images) for group in GROUPS if group in places]
    tree = "\n".join(group.replace("/", "-") for group in GROUPS if group in places)
    write_page(
        pages / "index.md",
        "# Gallery\n\nEvery named problem with the command that computes it and, where a "
        "reference result is stored, its figure, its headline number and its certificate.\n\n"
        "::::{grid} 1 2 3 3\n:gutter: 3\n\n" + "\n".join(cards) + "\n::::\n\n"
        f"```{{toctree}}\n:hidden:\n\n{tree}\n```\n",
    )


def _card(group: str, entries: list[Any], runs: dict[str, Run], images: Path) -> str:
    """A card of a group, with the picture of its first problem that has one."""
    pictures = [drawn(runs[e.name], images) for e in entries[:8] if e.name in runs]
    first = next((p for p in pictures if p), None)
    picture = f":img-top: ../_build/gallery/{first.name}\n" if first else ""
    return (
        f":::{{grid-item-card}} {GROUPS[group]}\n:link: {group.replace('/', '-')}\n"
        ":link-type: doc\n"
        f"{picture}\n{len(entries)} {'problem' if len(entries) == 1 else 'problems'}\n:::\n"
    )


def write_page(file: Path, text: str) -> None:
    """Write a page only where it changed, so that Sphinx reads it again only then."""
    if not file.exists() or file.read_text(encoding="utf-8") != text:
        file.write_text(text, encoding="utf-8")


def copy_notebooks(app: Any) -> None:
    """The notebooks of the repository as pages of the site."""
    folder = Path(app.srcdir) / "course"
    folder.mkdir(exist_ok=True)
    for file in sorted((ROOT / "notebooks").rglob("*.ipynb")):
        place = folder / file.name
        if not place.exists() or place.read_bytes() != file.read_bytes():
            shutil.copyfile(file, place)


def setup(app: Any) -> dict[str, bool]:
    app.connect("builder-inited", make)
    app.connect("builder-inited", copy_notebooks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
