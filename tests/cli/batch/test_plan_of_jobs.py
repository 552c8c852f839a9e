"""What is fed waits for what feeds it, and no worker waits for another's work."""

import pytest

from workbench.cli.batch import ended
from workbench.cli.batch.plan import JobPlan

FED = '''
"""Studies that are fed with one another."""

import xarray as xr

from workbench import Study, problem, ref


class Sum(Study):
    """How many runs there were."""

    def __init__(self, *runs):
        self.runs = runs

    def compute(self, context):
        return xr.Dataset({"count": len(self.runs)})

    def checks(self, answer, tolerance):
        return []


@problem("fed/base")
def base(scale: float = 1.0) -> Sum:
    """Fed with nothing."""
    return Sum()


@problem("fed/{side}/middle", side=("a", "b"), needs={"base": ref("fed/base", scale=2.0)})
def middle(side: str, base) -> Sum:
    """Both sides are fed with one run."""
    return Sum(base)


REST = [ref("fed/b/middle"), ref("fed/base")]


@problem("fed/top", needs={"a": ref("fed/a/middle"), "rest": REST})
def top(a, rest) -> Sum:
    """Fed with all."""
    return Sum(a, *rest)


@problem("fed/round", needs={"other": ref("fed/about")})
def in_a_circle(other) -> Sum:
    """Fed with what it feeds."""
    return Sum(other)


@problem("fed/about", needs={"other": ref("fed/round")})
def about(other) -> Sum:
    """Fed with what it feeds."""
    return Sum(other)


@problem("fed/lost", needs={"other": ref("fed/nowhere")})
def lost(other) -> Sum:
    """Fed with what there is not."""
    return Sum(other)
'''


@pytest.fixture
def fed(project):
    return project.write("plants/fed.py", FED)


def order(plan):
    """Names in the order in which one worker would take them."""
    taken = []
    while plan.waiting:
        (label,) = plan.ready(1, idle=True)
        taken.append(plan.calls[label][0])
        plan.over.add(label)
    return taken


def test_what_feeds_most_comes_first(fed):
    assert order(JobPlan(["fed/top"], {})) == [
        "fed/base",  # the one of scale 2, which feeds both sides
        "fed/a/middle",
        "fed/b/middle",
        "fed/base",
        "fed/top",
    ]


def test_what_is_fed_is_not_ready(fed):
    plan = JobPlan(["fed/top", "fed/a/middle", "fed/base"], {"scale": 2.0})
    # fed/top and fed/a/middle have no such parameter: their runs say so, and wait for nothing.
    assert {plan.calls[label][0] for label in plan.ready(9, idle=True)} == {
        "fed/top",
        "fed/a/middle",
        "fed/base",
    }
    plan = JobPlan(["fed/top", "fed/a/middle", "fed/base"], {})
    begun = list(plan.ready(9, idle=True))
    assert sorted(plan.calls[label][0] for label in begun) == ["fed/base", "fed/base"]
    assert [plan.named.get(label) for label in begun].count("fed/base") == 1
    assert list(plan.ready(9, idle=False)) == []
    plan.over.update(begun)
    assert len(list(plan.ready(1, idle=False))) == 1


def test_what_is_asked_to_another_accuracy_is_another_question(fed):
    plain, fine = (
        JobPlan(["fed/top", "fed/base"], {}),
        JobPlan(["fed/top", "fed/base"], {"fresh": True}),
    )
    assert len(plain.calls) == 5 and len(fine.calls) == 6


@pytest.mark.slow
def test_each_is_made_once(fed, project):
    runs = dict(ended(["fed/top", "fed/b/middle"], {}, jobs=2))
    assert all(run.holds for run in runs.values()) and set(runs) == {"fed/top", "fed/b/middle"}
    assert len(list(project.results.rglob("run.json"))) == 5


@pytest.mark.cases(0)
def test_a_circle_and_a_gap_are_told_by_the_run(fed):
    runs = dict(ended(["fed/round", "fed/lost"], {}, jobs=2))
    assert "cyclic needs" in str(runs["fed/round"])
    assert "fed/nowhere" in str(runs["fed/lost"])
