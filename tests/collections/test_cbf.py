"""Conic programs from CBF files; small ones whose optimum is known."""

import numpy as np
import pytest

import workbench as wb
from workbench.collections import read_cbf
from workbench.errors import InputError

MIXED = """\
# a matrix, a second-order cone and two equations
VER
1

OBJSENSE
MIN

PSDVAR
1
3

VAR
3 1
Q 3

CON
2 1
L= 2

OBJFCOORD
5
0 0 0 2
0 1 0 1
0 1 1 2
0 2 1 1
0 2 2 2

OBJACOORD
1
0 1

FCOORD
9
0 0 0 0 1
0 0 1 1 1
0 0 2 2 1
1 0 0 0 1
1 0 1 0 1
1 0 2 0 1
1 0 1 1 1
1 0 2 1 1
1 0 2 2 1

ACOORD
3
0 0 1
1 1 1
1 2 1

BCOORD
2
0 -1
1 -0.5
"""


def written(folder, text):
    file = folder / "program.cbf"
    file.write_text(text)
    return file


def solved(folder, text):
    program = read_cbf(written(folder, text))
    solution = wb.solve(program)
    assert solution.certificate is not None and solution.certificate.holds
    return program.metrics(solution.answer)["value"], solution.answer["x"].values


def cvxpy_value(build):
    import cvxpy as cp

    problem = build(cp)
    problem.solve(solver="CLARABEL")
    return problem.value


def test_a_mixed_program_is_that_which_cvxpy_states(tmp_path):
    def build(cp):
        X, x = cp.Variable((3, 3), PSD=True), cp.Variable(3)
        cost = np.array([[2, 1, 0], [1, 2, 1], [0, 1, 2]])
        rules = [cp.SOC(x[0], x[1:]), cp.trace(X) + x[0] == 1, cp.sum(X) + x[1] + x[2] == 0.5]
        return cp.Problem(cp.Minimize(cp.trace(cost @ X) + x[0]), rules)

    value, _ = solved(tmp_path, MIXED)
    assert value == pytest.approx(cvxpy_value(build), rel=1e-6)


LINEAR = (
    "VER\n2\nOBJSENSE\nMAX\nVAR\n3 3\nL+ 1\nL- 1\nF 1\nCON\n2 1\nL- 2\nOBJACOORD\n2\n0 2\n2 1\n"
)
LINEAR += "ACOORD\n3\n0 0 1\n0 2 1\n1 2 1\nBCOORD\n2\n0 -4\n1 -1\nOBJBCOORD\n10\n"


def test_a_program_to_be_maximised_tells_its_own_value(tmp_path):
    """max 2 x + z + 10 with x >= 0, y <= 0, x + z <= 4, z <= 1: x grows as z falls."""
    bounded = LINEAR.replace("F 1", "L+ 1")
    value, x = solved(tmp_path, bounded)
    assert value == pytest.approx(18.0, rel=1e-6)
    assert x[[0, 2]] == pytest.approx([4, 0], abs=1e-5)
    assert wb.solve(read_cbf(written(tmp_path, LINEAR))).outcome == "unbounded"


@pytest.mark.parametrize("size", [2, 3, 5])
def test_rotated_cones_are_exact(tmp_path, size):
    """min s_1 with s_2 = 2 and v = (1, ..., 1): 2 s_1 s_2 >= |v|^2."""
    fixed = "".join(f"{k} {k + 1} 1\n" for k in range(size - 1))
    text = f"VER\n1\nOBJSENSE\nMIN\nVAR\n{size} 1\nQR {size}\nCON\n{size - 1} 1\nL= {size - 1}\n"
    text += f"OBJACOORD\n1\n0 1\nACOORD\n{size - 1}\n{fixed}BCOORD\n{size - 1}\n0 -2\n"
    text += "".join(f"{k} -1\n" for k in range(1, size - 1))
    value, _ = solved(tmp_path, text)
    assert value == pytest.approx((size - 2) / 4, abs=2e-6)


def test_matrix_constraints(tmp_path):
    """min x_0 + x_1 with (x_0, 1; 1, x_1) >= 0: 2."""
    text = "VER\n1\nOBJSENSE\nMIN\nVAR\n2 1\nF 2\nPSDCON\n1\n2\nOBJACOORD\n2\n0 1\n1 1\n"
    text += "HCOORD\n2\n0 0 0 0 1\n0 1 1 1 1\nDCOORD\n1\n0 1 0 1\n"
    assert solved(tmp_path, text)[0] == pytest.approx(2.0, rel=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("VER\n1", "VAR\n1", "line 2: a file begins with VER, not with 'VAR'"),
        ("VER\n1", "VER\n4", "line 3: version 4"),
        ("MIN", "LEAST", "line 6: the sense is MIN or MAX, not 'LEAST'"),
        ("Q 3", "EXP 3", "line 14: cone 'EXP'; F, L=, L"),
        ("Q 3", "QR 1", "line 14: the size of QR must be a whole number from 2 on"),
        ("Q 3", "Q 2", "line 14: the cones of VAR have 2 scalars, not 3"),
        ("CON\n", "INT\n", "line 16: 'INT' is not read; keywords are ACOORD"),
        ("0 2 2 2", "0 2 3 2", "line 26: j 3, there are 3"),
        ("0 2 2 2", "1 2 2 2", "line 26: matrix 1, there are 1"),
        ("0 2 2 2", "0 1 2 2", "line 26: this entry was given before"),
        ("1 2 1\n\nBCOORD", "1 3 1\n\nBCOORD", "line 48: variable 3, there are 3"),
        ("1 -0.5\n", "2 -0.5\n", "line 53: constraint 2, there are 2"),
        ("1 -0.5\n", "1 x\n", "line 53: the value must be a finite number, not 'x'"),
        ("1 -0.5\n", "", "ends at line 52; needed is an entry"),
        ("0 0 1\n1 1 1", "0 1\n1 1 1", "line 46: 2 numbers; constraint, variable and value are"),
    ],
)
def test_a_malformed_cbf_file_names_its_line(tmp_path, old, new, message):
    assert old in MIXED
    with pytest.raises(InputError, match=message):
        read_cbf(written(tmp_path, MIXED.replace(old, new, 1)))
