"""What a stored run was asked that is not the default."""

import workbench
from workbench.cli.departures import departures


def test_only_what_is_not_the_default_is_told(project):
    assert departures(workbench.run("toy/root")) == {}
    assert departures(workbench.run("toy/root", scale=2.0, seed=7)) == {"scale": "2.0", "seed": "7"}


def test_parameters_of_a_problem_that_is_not_here_are_all_told(project):
    run = workbench.run("toy/root", scale=2.0)
    run.info["problem"] = "elsewhere/root"
    assert departures(run) == {"scale": "2.0", "copies": "1", "drawn": "false"}
