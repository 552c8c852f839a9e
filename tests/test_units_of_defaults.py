"""Numbers with a unit come from the system at hand or from the caller; what is left, and why.

Every default of a function or a field, and every constant of a module, that its docstring gives a
unit of time, frequency, length or voltage is found in the sources. 0 and infinity have no unit, and
angles and samples are none. So is
every range that `geomspace` or `logspace` spreads between two numbers.
"""

import ast
import math
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1] / "workbench"
UNIT = re.compile(r"\[(rad/s|k?Hz|m?s|us|1/s|m|mm|um|nm|V|A|N|W|kg|m/s|V/m)\]")
NAMES = re.compile(r"_(hz|seconds|s)$", re.IGNORECASE)
SPACED = re.compile("geomspace|logspace")
"""Functions of a range between two numbers."""

LEFT = {
    "time of this computer, not of a system": """
        bench/cells/answer.py: WARM_UP
        bench/cells/answer.py: CHECK_LIMIT
        bench/comparison/numbers.py: SHIFTS
        _core/machine_code/kept.py: LONGEST_COMPILATION
        executor/cluster.py: ANSWER
        executor/local_cluster.py: START
        executor/workers.py: LOOK
        synthesis/mu/finish.py: LEAST_SECONDS
        synthesis/mu/structured/starts/search.py: SHORTEST""",
    "width of a figure on paper": """
        figures/styles.py: NARROWEST
        figures/styles.py: WIDEST
        figures/styles.py: WIDTHS""",
    "1 where it is not given: times count samples then": """
        identification/experiments/several.py: Experiments(dt)
        identification/innovations/model.py: InnovationsModel(dt)
        identification/responses/periodic_local.py: periodic_local_polynomial(dt)
        identification/responses/periodic_local.py: response(dt)
        identification/state_space/identified.py: IdentifiedModels(dt)""",
    "how units are written": """
        synthesis/mu/member_figures.py: LONGEST_IN_MS""",
    "a multiple of the highest frequency given": """
        fitting/quadratic_factor.py: MISSING_ZERO_FACTOR""",
    "what doubles and their squares hold, in any unit": """
        systems/equations/riccati.py: FAR
        uncertainty/algebra/delays.py: LONGEST_DELAY
        uncertainty/algebra/delays.py: SHORTEST_DELAY""",
    "a range of multiples of the model's fastest pole": """
        diagnosis/generators/exact.py: SENSITIVITY_GRID from 0.01 to 100""",
    "a range of shares of half the sampling rate, or of multiples of it": """
        diagnosis/generators/exact.py: _combination from 0.001 to 1
        diagnosis/generators/exact.py: _normalised from 0.001 to 1
        synthesis/implementation/discretise.py: CHECKED_NYQUIST_RATIOS from 0 to 4
        synthesis/implementation/implementation_checks.py: follows from 1e-05 to 1
        synthesis/implementation/second_order.py: CHECKED_ANGLES from -6 to 0""",
    "a range of multiples of a scale of the system": """
        mu/robust/late_margin.py: NEARBY_RATIOS from 0.98 to 1.02
        second_opinion/margins/dead_times.py: _sizes from 0.5 to 2
        synthesis/implementation/sampled_response.py: MODE_OFFSETS from -2 to 2
        synthesis/implementation/sampled_response.py: MODE_OFFSETS from 2 to -2
        synthesis/families/lead_lag.py: examples from 0.1 to 1
        synthesis/families/observer.py: _is_same_response from 0.1 to 10
        synthesis/families/parametrised.py: parameters from 0.01 to 100
        synthesis/families/lead_lag.py: examples from 3 to 10
        synthesis/families/modal.py: examples from 0.3 to 3
        synthesis/families/three_terms.py: FILTERS from 0.001 to 1
        synthesis/families/three_terms.py: parameters from 0.001 to 3
        synthesis/mu/structured/starts/lag_rules.py: CLOSED_LOOP_TIMES from 0.1 to 10
        synthesis/records/riccati.py: MULTIPLIERS from 1e-08 to 1e+08
        systems/margins.py: highest_crossover from 1e-12 to 0.5""",
    "factors on a controller": """
        synthesis/designs.py: DESIGN_GAINS from 0.5 to 4""",
    "a system without poles and zeros, whose response is the same everywhere": """
        identification/rational_models/model.py: _points from 0.1 to 10""",
}
"""Why the numbers of some places belong to no system. The list only shrinks."""


def numbers(node: ast.expr | None) -> list[float]:
    """Numbers in an expression other than 0 and infinity."""
    found = [one.value for one in ast.walk(node) if isinstance(one, ast.Constant)] if node else []
    kinds = [one for one in found if isinstance(one, int | float) and not isinstance(one, bool)]
    return [one for one in kinds if one and math.isfinite(one)]


def places(source: str, path: str) -> Iterator[str]:
    """Places of one file whose numbers have a unit."""
    tree = ast.parse(source)
    constants = {}
    for node, after in zip(tree.body, [*tree.body[1:], None], strict=True):
        if not isinstance(node, ast.Assign | ast.AnnAssign):
            continue
        text = ""
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            text = str(after.value.value)
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        for name in [one.id for to in targets for one in ast.walk(to) if isinstance(one, ast.Name)]:
            constants[name] = numbers(node.value)
            if constants[name] and (UNIT.search(text) or NAMES.search(name)):
                yield f"{path}: {name}"
    if SPACED.search(source):
        yield from ranges(tree, path)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            text = ast.get_docstring(node) or ""
            for name, default in defaults(node):
                given = isinstance(default, ast.Name) and constants.get(default.id)
                if (given or numbers(default)) and (NAMES.search(name) or has_unit(name, text)):
                    yield f"{path}: {node.name}({name})"


def ranges(tree: ast.Module, path: str) -> Iterator[str]:
    """Ranges between two numbers, and the function or the constant that has them."""
    for outer in ast.walk(tree):
        if not isinstance(outer, ast.FunctionDef) and outer not in tree.body:
            continue
        if isinstance(outer, ast.ClassDef):
            continue
        name = getattr(outer, "name", "")
        if isinstance(outer, ast.Assign) and isinstance(outer.targets[0], ast.Name):
            name = outer.targets[0].id
        for call in ast.walk(outer):
            if not isinstance(call, ast.Call) or len(call.args) < 2:
                continue
            if SPACED.fullmatch(getattr(call.func, "attr", "")):
                ends = [literal(end) for end in call.args[:2]]
                if None not in ends:
                    yield f"{path}: {name} from {ends[0]:g} to {ends[1]:g}"


def literal(node: ast.expr) -> float | None:
    """The number that an expression is written as."""
    try:
        found = ast.literal_eval(node)
    except ValueError:
        return None
    return float(found) if isinstance(found, int | float) else None


def defaults(node: ast.FunctionDef | ast.ClassDef) -> list[tuple[str, ast.expr]]:
    """Names and defaults of parameters, or of fields."""
    if isinstance(node, ast.ClassDef):
        fields = [one for one in node.body if isinstance(one, ast.AnnAssign) and one.value]
        return [(one.target.id, one.value) for one in fields if isinstance(one.target, ast.Name)]
    every = [*node.args.posonlyargs, *node.args.args]
    pairs = list(zip(every[::-1], node.args.defaults[::-1], strict=False))
    pairs += zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
    return [(one.arg, default) for one, default in pairs if default is not None]


def has_unit(name: str, text: str) -> bool:
    """Whether a docstring names a parameter and a unit on its line or the next."""
    said = re.findall(rf"\b{name}\b[^\n]*\n?[^\n]*", text)
    return any(UNIT.search(one) for one in said)


def test_what_is_left_is_listed_with_its_reason():
    paths = sorted(ROOT.rglob("*.py"))
    found = {
        place
        for path in paths
        for place in places(path.read_text(encoding="utf-8"), path.relative_to(ROOT).as_posix())
    }
    left = {line.strip() for lines in LEFT.values() for line in lines.splitlines()} - {""}
    assert not found - left, "take these from the system or from the caller"
    assert not left - found, "strike these out: they are gone"


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ('LOWEST, HIGHEST = 1.0, 1e5\n"""Range [Hz] of a search."""', "LOWEST HIGHEST"),
        ('def f(rate=500.0):\n    """Settles at `rate` [1/s]."""', "f(rate)"),
        ('def f(end_hz=10):\n    """No unit said."""', "f(end_hz)"),
        ('END = 3.0\ndef f(*, end=END):\n    """To `end` [rad/s]."""', "f(end)"),
        ('class Law:\n    """Has a corner [Hz] of Q."""\n    corner: float = 200.0', "Law(corner)"),
        ("def f():\n    return np.geomspace(1.0, 1e5, 30)", "f from 1 to 100000"),
        ('GRID = np.logspace(-2, 2)\n"""Of a search."""', "GRID from -2 to 2"),
        ("def f(low):\n    return np.geomspace(low, 10 * low, 30)", ""),
        ('def f(dt=0.0):\n    """Sampling time dt [s]."""', ""),
        ('SHARE = 0.1\n"""Of the fastest pole."""', ""),
    ],
)
def test_a_number_with_a_unit_is_found(source, found):
    assert list(places(source, "m")) == (
        [f"m: {found}"] if " from " in found else [f"m: {name}" for name in found.split()]
    )
