"""The examples of the guides run as they stand."""

import re
from pathlib import Path

import numpy as np

import workbench as wb

GUIDE = Path(__file__).parents[1] / "docs/solvers.md"


def test_a_program_with_two_methods_takes_at_most_forty_lines():
    source = re.search(r"<!-- tested -->\n```python\n(.*?)```", GUIDE.read_text(), re.DOTALL)[1]
    code = [line for line in source.splitlines() if line.strip() and "import" not in line]
    assert len(code) <= 40
    space: dict = {"__name__": "guide"}
    exec(compile(source, str(GUIDE), "exec"), space)
    A, b = np.vstack([np.eye(2), -np.eye(2), [[1.0, 1.0]]]), np.array([1.0, 1, 0, 0, 1.5])
    program = space["NearestPoint"](A, b, np.array([2.0, 2.0]))
    expected = np.array([0.75, 0.75])
    for method in ("clarabel", "scs", "cvxopt", "projections"):
        solution = wb.solve(program, method=method)
        assert solution.outcome == "solved", (method, solution.message)
        np.testing.assert_allclose(solution.answer["x"], expected, atol=1e-4)
    outside = program.certify(solution.answer + 0.1, 1e-6)
    assert not outside.valid
