"""Private parts of Numba and LLVM are used behind one door, and never needed."""

import ast
import json
import subprocess
import sys
import tomllib
import warnings
from pathlib import Path

import llvmlite
import numba
import numpy as np
import pytest

from workbench._core.machine_code import door
from workbench._core.machine_code.door import RELEASES, Road, plain_way

ROOT = Path(__file__).parents[3]
ROOM = ROOT / "workbench" / "_core" / "machine_code"
PRIVATE = {"core", "cpython", "llvmlite", "misc", "np", "parfors", "stencils"}
"""Parts of Numba that its manual for users does not describe."""
MEMBERS = {"_nrt", "no_cpython_wrapper", "no_cfunc_wrapper", "overloads", "targetctx", "fndesc"}
MEMBERS |= {"get_pointer_to_function", "_cache_file", "_compiler", "_can_compile"}
"""Options of Numba, and members of its functions, that it does not describe either."""


def private_use(text):
    """Private parts of Numba and llvmlite that a source names."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        named, members = [], set()
        if isinstance(node, ast.Import):
            named = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            named = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Attribute):
            named, members = [ast.unparse(node)], {node.attr}
        elif isinstance(node, ast.keyword):
            members = {node.arg}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            members = {node.value}
        for name in named:
            first, _, rest = name.partition(".")
            part = rest.partition(".")[0]
            if first == "llvmlite" or (first == "numba" and (part in PRIVATE or part[:1] == "_")):
                found.add(name)
        found |= members & MEMBERS
    return found


def test_only_the_room_of_machine_code_uses_private_parts():
    files = [file for top in ("workbench", "problems") for file in (ROOT / top).rglob("*.py")]
    used = {
        file.relative_to(ROOT).as_posix(): names
        for file in files
        if file.parent != ROOM and (names := private_use(file.read_text(encoding="utf-8")))
    }
    assert not used


@pytest.mark.parametrize(
    ("text", "private"),
    [
        ("from numba.core import types", True),
        ("from numba import core", True),
        ("import numba.core.event as event", True),
        ("import numba\nnumba.core.event.register", True),
        ("from numba.np.arrayobj import make_array", True),
        ("from llvmlite import ir", True),
        ("def f():\n    import llvmlite.binding", True),
        ("numba.njit(_nrt=False)(f)", True),
        ("options = {'no_cpython_wrapper': True}", True),
        ("f.overloads", True),
        ("from numba import njit, types\nimport numba\nnumba.prange", False),
        ("from numba.extending import intrinsic\nfrom numba.typed import List", False),
        ("import numpy as np\nnp.core", False),
    ],
)
def test_private_use_is_seen(text, private):
    assert bool(private_use(text)) == private


def test_the_room_needs_its_private_parts():
    assert all(
        private_use(file.read_text(encoding="utf-8"))
        for file in ROOM.glob("*.py")
        if file.stem != "__init__"
    )


def _release(text):
    return tuple(map(int, text.split(".")[:2]))


@pytest.mark.parametrize("name", RELEASES)
def test_the_ceiling_is_just_above_the_release_that_is_tested(name):
    """A release is let in by testing it: `requirements.txt`, `pyproject.toml` and door together."""
    first, beyond = RELEASES[name]
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = f"{name}>={'.'.join(map(str, first))},<{'.'.join(map(str, beyond))}"
    assert asked in declared["dependencies"]
    pinned = (ROOT / "requirements.txt").read_text(encoding="utf-8").splitlines()
    (tested,) = (line.partition("==")[2] for line in pinned if line.startswith(f"{name}=="))
    assert beyond == (_release(tested)[0], _release(tested)[1] + 1)


@pytest.mark.parametrize("package", [numba, llvmlite], ids=lambda package: package.__name__)
@pytest.mark.parametrize("release", ["0.1.0", "99.0", "0.690.0", "dev"])
def test_another_release_is_not_let_in(package, release, monkeypatch):
    monkeypatch.setattr(package, "__version__", release)
    with pytest.raises(ImportError, match=f"{package.__name__} {release} was not tested, 0"):
        door.check_releases()


def test_a_road_is_tested_once_and_left_alone_in_the_plain_way():
    tests = []
    taken = Road("answers", lambda: tests.append(1) or "road")
    with plain_way(), plain_way():
        assert taken.taken() is None
    assert not tests
    assert [taken.taken() for _ in range(3)] == ["road"] * 3
    assert tests == [1] and not taken.reason


def fails(error):
    def failing():
        raise error

    return failing


@pytest.mark.parametrize("error", [ImportError("no ir"), AttributeError("gone"), TypeError("two")])
def test_a_road_that_fails_is_left_and_this_is_told_once(error, monkeypatch):
    monkeypatch.setattr(door, "_told", set())
    wrong, again = Road("answers", fails(error)), Road("others", fails(error))
    with pytest.warns(RuntimeWarning, match="answers: plain code is used, .*same results"):
        assert wrong.taken() is None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert wrong.taken() is None
        assert again.taken() is None  # for the same reason
    assert wrong.reason == again.reason == f"{type(error).__name__}: {error}"


def test_a_warning_that_is_an_error_is_raised_once(monkeypatch):
    monkeypatch.setattr(door, "_told", set())
    wrong = Road("answers", fails(ImportError("no ir")))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(RuntimeWarning, match="no ir"):
            wrong.taken()
        assert wrong.taken() is None


def test_a_test_that_is_interrupted_is_made_again():
    outcomes = [fails(KeyboardInterrupt()), lambda: "road"]
    taken = Road("answers", lambda: outcomes.pop(0)())
    with pytest.raises(KeyboardInterrupt):
        taken.taken()
    assert taken.taken() == "road"


CHILD = """
import importlib, json, sys, types, warnings
import numba
def hide(name, member):
    # Imports from now on find no such member; the module's own code still does.
    module = importlib.import_module(name)
    bare = types.ModuleType(name)
    vars(bare).update({{key: one for key, one in vars(module).items() if key != member}})
    package, _, last = name.rpartition(".")
    sys.modules[name] = bare
    setattr(sys.modules[package], last, bare)
{change}
sys.path.insert(0, "tests/simulation")
import numpy as np
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    import test_machine
    from workbench.mu import Complex, Full, Real, Structure, upper_bound
    from workbench.mu.upper.multipliers import LANES
    from workbench.simulation import adder, play
    from workbench.simulation.road import SIMULATION
    real, imaginary = np.random.default_rng(5).normal(size=(2, 30, 4, 4))
    bounds = upper_bound(real + 1j * imaginary, Structure([Real(1), Complex(1), Full(2, 2)])).value
    rng = np.random.default_rng(6)
    signals = [0.1 * rng.normal(size=size) for size in ((60, 2), (61, 2), (60, 3))]
    output = test_machine.loop(0.4, 2).run(test_machine.cascade(), *signals).output
    played = play(adder(), signals[0])
told = [str(one.message) for one in caught if one.category is RuntimeWarning]
answer = [bounds.tolist(), output.tolist(), played.tolist()]
roads = [LANES.taken() is not None, SIMULATION.taken() is not None]
print(json.dumps([answer, roads, told]))
"""


def answers(change=""):
    done = subprocess.run(
        [sys.executable, "-c", CHILD.format(change=change)],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert not done.returncode, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def fast():
    answer, roads, told = answers()
    assert roads == [True, True] and not told
    return answer


WRONG = """
import workbench.mu.upper.lanes.path as path
followed = path.follow_paths
def wrong(*given):
    followed(*given)
    given[5][:] = 1.0  # D
path.follow_paths = wrong
import workbench.simulation.machine as machine
turned = machine.fast_loop
def turned_wrongly(*given):
    stop = turned(*given)
    given[6][5][1][-1] += 1e-6  # the last output
    return stop
machine.fast_loop = turned_wrongly
"""
FAULTS = {
    "a member is gone": ("hide('numba.np.arrayobj', 'populate_array')", [False, False], 1),
    "another member is gone": ("hide('llvmlite.ir', 'VectorType')", [False, True], 1),
    "a self-test is wrong": (WRONG, [False, False], 2),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_without_a_road_the_answers_are_the_same(fault, fast):
    change, open_roads, reasons = FAULTS[fault]
    (bounds, output, played), roads, told = answers(change)
    assert roads == open_roads
    assert len(told) == reasons and all("slower and with the same results" in one for one in told)
    np.testing.assert_allclose(bounds, fast[0], rtol=1e-6)
    assert output == fast[1] and played == fast[2]


@pytest.mark.slow  # every function is compiled anew, for a minute
@pytest.mark.parametrize(
    ("change", "open_roads"),
    [
        ("numba.__version__ = '99.0.0'", [False, False]),
        ("hide('numba.core.event', 'register')", [True, True]),
    ],
    ids=["release", "member"],
)
def test_where_no_compiled_code_is_kept_the_answers_are_the_same(change, open_roads, fast):
    (bounds, output, played), roads, told = answers(change)
    assert "compiled functions: plain code is used" in told[0] and len(told) == 1
    assert roads == open_roads
    np.testing.assert_allclose(bounds, fast[0], rtol=1e-6)
    np.testing.assert_allclose(output, fast[1], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(played, fast[2], rtol=1e-12)
