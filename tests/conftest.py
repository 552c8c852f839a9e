"""A small project of its own for tests of the bench: square roots, whose answers everyone knows."""

from __future__ import annotations

import gc
import importlib
import importlib.util
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import lanes
import pytest
from cpu_seconds import CpuSeconds
from hypothesis import HealthCheck, settings

# The same examples every time, however slowly a busy machine makes them.
settings.register_profile(
    "workbench", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("workbench")


HANGS = 600
"""Seconds after which a process counts as one that hangs, on a machine that does much else."""


CHOSEN, SAMPLED = "--chosen", "--sampled"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(CHOSEN, help="Run the tests alone that this file of tests/changed.py names.")
    told = f"Run a few cases of each test with parameters, others if {lanes.TURN} is set."
    parser.addoption(SAMPLED, action="store_true", help=told)


def pytest_configure(config: pytest.Config) -> None:
    """Property tests try fewer examples where the slow tests are left out (`lanes.examples`)."""
    config.pluginmanager.register(CpuSeconds(config), "cpu-seconds")
    if "not slow" in config.getoption("markexpr"):
        os.environ[lanes.ENVIRONMENT] = "1"
    else:
        os.environ.pop(lanes.ENVIRONMENT, None)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """What is collected stays to the end: there is no garbage to look for, then or later."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(trylast=True)  # after the marks have chosen
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Of `make quick`: what an edit reaches, the nearest first; of `make test`: a sample."""
    if told := config.getoption(CHOSEN):
        from quick.order import keep_chosen

        config.hook.pytest_deselected(items=keep_chosen(items, Path(told), config.rootpath))
    if config.getoption(SAMPLED):
        turn = int(os.environ.get(lanes.TURN, 0))
        config.hook.pytest_deselected(items=lanes.keep_sample(items, turn))


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of this checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder]
    subprocess.run(command, cwd=Path(__file__).parents[1], check=True, stdout=subprocess.DEVNULL)
    return next(folder.glob("robust_workbench-*.whl"))


@pytest.fixture(scope="session")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the wheel unpacked, beside nothing of the checkout."""
    folder = tmp_path_factory.mktemp("installed")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    return folder


@pytest.fixture
def elsewhere(installed: Path, tmp_path: Path) -> Callable[..., str]:
    """Run Python with the installed workbench in an empty folder; its output, its end checked."""

    def python(*words: str) -> str:
        done = subprocess.run(
            [sys.executable, "-P", *words],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(installed)},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return python


TOY = '''
"""Square roots, by good methods and bad ones."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from workbench import Check, Outcome, Program, Study, method, problem, ref

OFFSET = 0.0  # tests edit this line
PAUSE = 0.0  # and this one


@dataclass(frozen=True)
class Root(Program):
    """The least x with x * x >= target, for each target."""

    targets: tuple
    drawn: bool = False

    default_method = "exact"
    headline = "largest"

    def checks(self, answer, tolerance):
        short = np.max(np.array(self.targets) - answer**2)
        return [Check("reach", "target - x^2", float(short), 1e-9, where="over all targets")]

    def gap(self, answer):
        return "x / sqrt(target) - 1", float(np.max(answer / np.sqrt(self.targets) - 1))

    def metrics(self, answer):
        return {"largest": float(np.max(answer)), "count": len(self.targets)}

    def figures(self, answer):
        from workbench.figures import axes

        if not self.drawn:
            return {}
        figure, (panel,) = axes(1, 1)
        panel.plot(self.targets, answer)
        return {"roots": figure}

    def to_dataset(self, answer):
        return xr.Dataset(
            {
                "x": ("target", answer, {"units": "m"}),
                "phasor": ("target", answer * np.exp(1j * answer)),
            },
            {"target": ("target", list(self.targets), {"units": "m^2"})},
        )

    def from_dataset(self, data):
        return data["x"].values


def roots(program):
    return np.sqrt(np.array(program.targets)) + OFFSET


@method(Root, "exact", optimal=True)
def exact(program, context):
    """The square root."""
    return roots(program), Outcome.SOLVED, "as good as it gets"


@method(Root, "rough", optimal=False)
def rough(program, context):
    """Half again as large as it need be, and says nothing else."""
    return 1.5 * roots(program), Outcome.SOLVED, ""


@method(Root, "boastful", optimal=True)
def boastful(program, context):
    """Half again as large as it need be, and claims to be the least."""
    return 1.5 * roots(program), Outcome.SOLVED, ""


@method(Root, "lying", optimal=True)
def lying(program, context):
    """Claims what is not so."""
    return 0 * roots(program), Outcome.SOLVED, "trust me"


@method(Root, "modest", optimal=True)
def modest(program, context):
    """Is right and does not know it."""
    return roots(program), Outcome.INACCURATE, "not sure"


@method(Root, "nan", optimal=False)
def nan(program, context):
    return np.nan * roots(program), Outcome.SOLVED, ""


@method(Root, "nothing", optimal=False)
def nothing(program, context):
    return None


@method(Root, "empty", optimal=True)
def empty(program, context):
    return None, Outcome.SOLVED, "solved, but where is it?"


@method(Root, "unsure", optimal=True)
def unsure(program, context):
    return None, Outcome.INACCURATE, "stalled"


@method(Root, "hopeless", optimal=True)
def hopeless(program, context):
    return None, Outcome.INFEASIBLE, "there is none"


@method(Root, "garbage", optimal=True)
def garbage(program, context):
    return "forty-two", Outcome.SOLVED, ""


@method(Root, "raising", optimal=True)
def raising(program, context):
    raise ArithmeticError("the sky fell")


@method(Root, "interrupted", optimal=True)
def interrupted(program, context):
    raise KeyboardInterrupt


@method(Root, "random", optimal=False)
def random(program, context):
    return roots(program) * (1 + context.rng.random()), Outcome.SOLVED, ""


@method(Root, "patient", optimal=True)
def patient(program, context):
    for _ in context.track(range(1000), "waiting"):
        time.sleep(0.001)
    return roots(program), Outcome.SOLVED, ""


@method(Root, "newton", optimal=True)
def newton(program, context):
    """Newton's iteration from above, by which every round is valid and the last one exact."""
    targets, kept = np.array(program.targets), context.checkpoint.load()
    state = {"x": targets + 1, "excess": np.zeros(0)} if kept is None else kept
    for number, excess in enumerate(state["excess"].tolist(), start=1):
        context.record({"round": number, "excess": excess})
    for done in context.rounds(12, "newton", first=len(state["excess"])):
        x = (state["x"] + targets / state["x"]) / 2
        excess = float(np.max(x / np.sqrt(targets) - 1))
        context.record({"round": done + 1, "excess": excess})
        state = {"x": x, "excess": np.append(state["excess"], excess)}
        context.checkpoint.save(state)
        time.sleep(PAUSE)
    return state["x"] + OFFSET, Outcome.SOLVED, "twelve rounds"


@method(Root, "hanging", optimal=True)
def hanging(program, context):
    while True:
        time.sleep(0.01)


@method(Root, "dying", optimal=True)
def dying(program, context):
    os._exit(7)


@method(
    Root,
    "picky",
    optimal=True,
    unfit=lambda p: "it counts to three" if len(p.targets) > 3 else None,
)
def picky(program, context):
    """Counts to three."""
    return roots(program), Outcome.SOLVED, ""


@dataclass(frozen=True, eq=False)
class Total(Study):
    """The sum of the roots of several runs."""

    parts: tuple

    headline = "total"

    def compute(self, context):
        total = sum(float(run.data["x"].sum()) for run in self.parts)
        return xr.Dataset({"total": ((), total + OFFSET, {"units": "m"})})

    def checks(self, answer, tolerance):
        return [Check("positive", "-total", -float(answer["total"]), 0.0)]

    def metrics(self, answer):
        return {"total": float(answer["total"]), "share": float("inf"), "hole": float("nan")}

    def figures(self, answer):
        return {}


@problem("toy/root", data="targets.csv")
def root(scale: float = 1.0, copies: int = 1, drawn: bool = False) -> Root:
    """Least roots of the targets (table 1).

    scale: what they are multiplied by.
    """
    text = (Path(__file__).parent / "targets.csv").read_text()
    targets = [scale * float(word) for word in text.split(",")]
    return Root(tuple(targets * copies), drawn)


@problem("toy/{axis}/root", axis=("x", "y"))
def axis_root(axis: str) -> Root:
    """Root of an axis."""
    return Root(({"x": 4.0, "y": 9.0}[axis],))


@problem("toy/total", needs={"part": ref("toy/root", scale=4.0)})
def total(part) -> Total:
    """Total of the roots (table 2)."""
    return Total((part,))


@problem(
    "toy/{axis}/total",
    axis=("x", "y"),
    needs={"part": ref("toy/{axis}/root", method="rough")},
)
def axis_total(axis: str, part) -> Total:
    """Total of an axis."""
    return Total((part,))


@problem(
    "toy/sum",
    needs=lambda count: {"parts": [ref("toy/root", scale=i + 1.0) for i in range(count)]},
)
def sum_(parts, count: int = 2) -> Total:
    """Sum over a fan of roots."""
    return Total(tuple(parts))


@problem("toy/doomed", needs={"part": ref("toy/root", method="lying")})
def doomed(part) -> Total:
    """Fed with a lie."""
    return Total((part,))


@problem("toy/loop/a", needs={"other": ref("toy/loop/b")})
def loop_a(other) -> Total:
    """Needs b."""


@problem("toy/loop/b", needs={"other": ref("toy/loop/a")})
def loop_b(other) -> Total:
    """Needs a."""


@problem("toy/late", slow=True)
def late() -> Root:
    """Takes its time."""
    return Root((1.0,))


@problem("toy/broken")
def broken() -> Root:
    """Its data cannot be bound."""
    raise ZeroDivisionError("one over nothing")


@problem("toy/text")
def text() -> str:
    """Neither a Program nor a Study."""
    return "text"
'''


@dataclass(frozen=True)
class Project:
    """A project below a temporary folder, with a problem folder ``plants/toy``."""

    root: Path

    @property
    def toy(self) -> Path:
        return self.root / "plants" / "toy" / "problems.py"

    @property
    def results(self) -> Path:
        return self.root / "results"

    def write(self, name: str, text: str) -> Path:
        """Write a file of the project; the bench sees it as a new process would."""
        file = self.root / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
        self.restart()
        return file

    def edit(self, old: str, new: str, name: str = "plants/toy/problems.py") -> None:
        """Replace a text in a file of the project."""
        text = (self.root / name).read_text(encoding="utf-8")
        assert old in text
        self.write(name, text.replace(old, new))

    def restart(self) -> None:
        """Forget what this process knows of problems and sources."""
        from workbench.bench import problem, project

        project._registry.cache_clear()
        problem._imported.clear()
        importlib.invalidate_caches()
        for name in [name for name in sys.modules if name.startswith("workbench_problems_")]:
            del sys.modules[name]

    def start(self, code: str) -> subprocess.Popen[str]:
        """Start a Python process in the project."""
        return subprocess.Popen(
            [sys.executable, "-c", code],
            cwd=self.root,
            env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def python(self, code: str) -> str:
        """Output of a Python process in the project, which must end well."""
        with self.start(code) as process:
            out, err = process.communicate(timeout=HANGS)
        assert process.returncode == 0, err
        return out.strip()


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Project]:
    from workbench.bench import project as here

    monkeypatch.setenv(here.RESULTS, "")  # what a test sets is undone
    monkeypatch.setattr(here, "_added", [])
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # edits may come within a second
    monkeypatch.chdir(tmp_path)
    made = Project(tmp_path)
    made.write("pyproject.toml", '[tool.workbench]\nproblems = ["plants"]\n')
    made.write("plants/toy/problems.py", TOY)
    made.write("plants/toy/targets.csv", "1,4,2\n")
    before = _registered()
    yield made
    made.restart()
    _forget_methods(before)


def _registered() -> dict[type, set[str]]:
    """Names of the methods of every Program."""
    from workbench.program import _METHODS

    return {program: set(entries) for program, entries in _METHODS.items()}


def _forget_methods(before: dict[type, set[str]]) -> None:
    """Take back what a test registered; a library module may be imported first by any test."""
    from workbench.program import _METHODS

    for program, entries in _METHODS.items():
        for name in set(entries) - before.get(program, set()):
            if not entries[name].answer.__module__.startswith(("workbench.", "problems.")):
                del entries[name]


@pytest.fixture(scope="session")
def toy(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """The toy's module by itself, without the bench."""
    file = tmp_path_factory.mktemp("toy") / "toy.py"
    file.write_text(TOY, encoding="utf-8")
    spec = importlib.util.spec_from_file_location("toy", file)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules["toy"] = module
    spec.loader.exec_module(module)
    return module
