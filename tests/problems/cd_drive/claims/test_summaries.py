"""The stored numbers of other readings are those of runs that can be made again."""

import json
from itertools import islice

import pytest
from workbench.plants.cd_drive.claims import summaries
from workbench.plants.cd_drive.claims.items import Found

from workbench.bench.project import registry
from workbench.bench.run import Bound
from workbench.solvers import Options

ROWS = summaries.read()
WITHOUT_NEEDS = (
    "drives",
    "gain-ramp",
    "position-estimator",
    "diode-plane",
    "sensitivity",
    "open-loop",
    "exact-residuals",
    "circles",
    "optical-gain",
    "linearity",
)


def question(problem, parameters):
    """The question of a problem that is fed with nothing."""
    entry = registry().find(problem)
    bound = entry.bind(parameters)
    task = entry.task(bound, {})
    return Bound(entry, entry.asked(bound), {}, task).question(None, Options())


def test_every_row_is_asked_for():
    wanted = summaries.wanted()
    for row in ROWS:
        _, quantities = wanted[row.problem, row.parameters]
        assert row.quantity in quantities


def test_a_run_has_all_of_its_numbers():
    wanted, stored = summaries.wanted(), summaries.stored()
    for problem, parameters in {(row.problem, row.parameters) for row in ROWS}:
        for quantity in wanted[problem, parameters][1]:
            assert (problem, parameters, quantity) in stored


def test_the_keys_are_those_of_the_questions():
    runs = {(row.problem, row.parameters): row.key for row in ROWS}
    checked = 0
    for (problem, parameters), key in runs.items():
        if problem.endswith(WITHOUT_NEEDS):
            asked = {**json.loads(parameters), **summaries.shorter(problem)}
            assert question(problem, asked).key == key
            checked += 1
    assert checked > 20


def test_a_run_made_again_has_the_stored_numbers():
    import workbench as wb

    rows = [row for row in ROWS if row.problem == "cd/drives"]
    again = wb.solve(registry_task("cd/drives", json.loads(rows[0].parameters)))
    metrics = registry_task("cd/drives", json.loads(rows[0].parameters)).metrics(again.answer)
    named = [row for row in rows if row.quantity in metrics]
    assert named
    for row in islice(named, 5):
        assert metrics[row.quantity] == pytest.approx(row.value, rel=1e-5)


def registry_task(problem, parameters):
    """The task of a problem that is fed with nothing."""
    entry = registry().find(problem)
    return entry.task(entry.bind(parameters), {})


def test_what_is_written_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(summaries, "FILE", tmp_path / "summaries.csv")
    row = summaries.Summary("a/run", '{"x": 1}', "0123abcd", "", "m", 1.5, float("-inf"), 2.0)
    summaries.write([row])
    assert summaries.read() == [row]
    assert Found(row.value, row.low, row.high).value == 1.5
