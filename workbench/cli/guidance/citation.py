"""BibTeX entries for a problem's results: this software, the thesis, the methods used."""

from __future__ import annotations

import re
from importlib import resources

import workbench
from workbench.bench.project import registry
from workbench.program import Program

THESIS = ("cd/", "cd-arm/", "bench/cd-arm")
"""First parts of the names of problems whose data or questions come from the thesis."""
OF_METHODS = {
    "ab13md": ("benner1999", "fan1991"),
    "basis": ("diamond2016",),
    "clarabel": ("goulart2024", "diamond2016"),
    "cvxopt": ("cvxopt", "diamond2016"),
    "dgk": ("young1993",),
    "dk": ("doyle1982",),
    "fast": ("fan1991",),
    "ipopt": ("wachter2006", "andersson2019"),
    "mu-dk": ("tofner1995",),
    "riccati": ("doyle1989",),
    "sb10ad": ("benner1999",),
    "scs": ("odonoghue2016", "diamond2016"),
    "sk": ("sanathanan1963",),
    "vector-fitting": ("gustavsen1999",),
}
"""Bibliography keys of each method; a chain such as "dk+fixed" has the keys of its parts."""


def citation(name: str) -> str:
    """BibTeX entries for a named problem: software, thesis, and the methods of its stored runs.

    Parameters
    ----------
    name
        A registered name. If no run of it is stored, the references are those of its default
        method.

    Raises
    ------
    UnknownNameError
        No such problem.
    """
    problem = registry().find(name)
    used = {run.method for run in workbench.results(name) if run.method}
    if not used:
        kind = problem.kind
        own = kind.default_method if kind is not None and issubclass(kind, Program) else None
        used = {problem.settings.method or own or ""}
    keys = ["vidal2003"] if name.startswith(THESIS) else []
    for method in sorted(used):
        for part in re.split(r"[+,]", method):
            keys += [key for key in OF_METHODS.get(part, ()) if key not in keys]
    known = references()
    return "\n\n".join([software(), *(known[key] for key in keys)])


def software() -> str:
    """The BibTeX entry of this version."""
    return (
        "@software{robust_workbench,\n"
        "  author = {{The workbench developers}},\n"
        "  title = {workbench: a research workbench for optimisation-centric robust control},\n"
        f"  version = {{{workbench.__version__}}}\n}}"
    )


def references() -> dict[str, str]:
    """The entries of the bibliography by their keys."""
    text = (
        resources.files("workbench.cli.guidance")
        .joinpath("references.bib")
        .read_text(encoding="utf-8")
    )
    entries = re.findall(r"^@.*?(?=^@|\Z)", text, re.MULTILINE | re.DOTALL)
    return {one.partition("{")[2].partition(",")[0]: one.strip() for one in entries}
