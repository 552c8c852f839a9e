"""The orders of two plants are found from noisy responses."""

import pytest
from workbench.plants.textbook.rational_model import rational_model

import workbench as wb


@pytest.mark.cases(0)
@pytest.mark.parametrize(
    ("plant", "order"), [pytest.param("delay", 1, marks=pytest.mark.slow), ("two-masses", 4)]
)
def test_the_order_of_a_rational_model_is_found(plant, order):
    for draw in range(2):
        program = rational_model(plant, draw=draw)
        solution = wb.solve(program)
        assert solution.certificate.valid, solution.certificate.failures
        assert solution.answer.model.order == order
        assert (solution.answer.model.delay == 0).all() == (plant == "two-masses")
