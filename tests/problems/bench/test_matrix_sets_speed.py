"""The smallest sets of matrices, timed beside semidefinite programs."""

import workbench as wb


def test_the_methods_agree_and_are_drawn():
    study = wb.load("bench/matrix-sets", frequencies=5, plants=6)
    solution = wb.solve(study)
    checks = {check.name: check for check in solution.certificate.checks}
    assert checks["methods agree"].holds
    assert study.metrics(solution.answer)["barrier_over_clarabel"] > 0
    assert "ratios" in study.figures(solution.answer)
