"""Semidefinite programs from files; small ones whose optimum is known."""

import numpy as np
import pytest

import workbench as wb
from workbench.certify.cones.form import ConeKind
from workbench.collections import read_sdpa
from workbench.errors import InputError
from workbench.solvers import conic_solvers

DIAGONAL = """\
"the largest eigenvalue of diag(1, 2) is 2, and x >= 2.5 beside it
* another comment
1 = mDIM
2 = nBLOCK
(2, -1) = bLOCKsTRUCT
{1.0}
0 1 1 1 1.0
0 1 2 2 2.0
1 1 1 1 1.0
1 1 2 2 1.0
0 2 1 1 2.5
1 2 1 1 1.0
"""


def written(folder, text, name="program.dat-s"):
    file = folder / name
    file.write_text(text)
    return file


def of_matrix(M):
    """min t with t I - M >= 0: its optimum is the largest eigenvalue of M."""
    n = len(M)
    lines = ["1", "1", str(n), "1.0"]
    lines += [f"1 1 {i + 1} {i + 1} 1" for i in range(n)]
    lines += [f"0 1 {i + 1} {j + 1} {M[i, j]!r}" for i in range(n) for j in range(i, n)]
    return "\n".join(lines).replace("np.float64(", "").replace(")", "")


def of_graph(n, edges):
    """Lovasz's theta as its dual: min t with t I + sum x_e E_e - J >= 0."""
    lines = [str(1 + len(edges)), "1", str(n), " ".join(["1", *["0"] * len(edges)])]
    lines += [f"0 1 {i + 1} {j + 1} 1" for i in range(n) for j in range(i, n)]
    lines += [f"1 1 {i + 1} {i + 1} 1" for i in range(n)]
    lines += [f"{k + 2} 1 {i + 1} {j + 1} 1" for k, (i, j) in enumerate(edges)]
    return "\n".join(lines)


@pytest.mark.parametrize("solver", [one.name for one in conic_solvers()])
def test_a_small_program_by_every_solver(tmp_path, solver):
    program = read_sdpa(written(tmp_path, DIAGONAL))
    assert [cone.kind for cone in program.form.cones] == [
        ConeKind.SEMIDEFINITE,
        ConeKind.NONNEGATIVE,
    ]
    solution = wb.solve(program, method=solver)
    assert solution.outcome == "solved"
    assert solution.answer["x"].values == pytest.approx([2.5], abs=1e-6)


def test_the_largest_eigenvalue_is_the_optimum(tmp_path):
    M = np.random.default_rng(0).standard_normal((8, 8))
    M += M.T
    program = read_sdpa(written(tmp_path, of_matrix(M)))
    solution = wb.solve(program)
    assert solution.certificate.holds
    value = program.metrics(solution.answer)["value"]
    assert value == pytest.approx(np.linalg.eigvalsh(M)[-1], rel=1e-6)


@pytest.mark.parametrize("n", [5, 7])
def test_theta_of_an_odd_cycle(tmp_path, n):
    """n cos(pi / n) / (1 + cos(pi / n)): L. Lovasz, On the Shannon capacity of a graph, 1979."""
    edges = [(i, i + 1) for i in range(n - 1)] + [(0, n - 1)]
    program = read_sdpa(written(tmp_path, of_graph(n, edges)))
    solution = wb.solve(program)
    assert solution.certificate.holds
    expected = n * np.cos(np.pi / n) / (1 + np.cos(np.pi / n))
    assert program.objective(solution.answer) == pytest.approx(expected, rel=1e-6)


def test_infeasible_and_unbounded_programs_are_proven(tmp_path):
    apart = "1\n2\n-1 -1\n1\n0 1 1 1 1\n1 1 1 1 1\n0 2 1 1 0\n1 2 1 1 -1\n"  # x >= 1 and -x >= 0
    assert wb.solve(read_sdpa(written(tmp_path, apart))).outcome == "infeasible"
    below = "1\n1\n2\n-1\n0 1 1 1 1\n1 1 1 1 1\n1 1 2 2 1\n"  # max x with x I >= diag(1, 0)
    assert wb.solve(read_sdpa(written(tmp_path, below))).outcome == "unbounded"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("1 = mDIM", "x = mDIM", "line 3: m must be a whole number from 1 on, not 'x'"),
        ("2 = nBLOCK", "0", "line 4: nblocks must be"),
        ("(2, -1)", "(2)", "line 5: the size of a block must be a whole number, not 'bLOCKsTRUCT'"),
        ("(2, -1)", "(2, 0)", "line 5: 2 sizes of blocks are needed, none of them 0"),
        ("{1.0}", "{1.0, 2.0}", "line 6: the objective has 2 entries, 1 are needed"),
        ("{1.0}", "{nan}", "line 6: c must be a finite number, not 'nan'"),
        ("0 1 1 1 1.0", "0 1 1 1", "line 7: 4 numbers; needed are matrix, block, i, j and value"),
        ("0 1 1 1 1.0", "2 1 1 1 1.0", "line 7: matrix 2 of 1 variables"),
        ("0 1 1 1 1.0", "0 3 1 1 1.0", "line 7: the block is 3, there are 2"),
        ("0 1 2 2 2.0", "0 1 2 3 2.0", "line 8: j is 3, there are 2"),
        ("0 1 2 2 2.0", "0 1 0 2 2.0", "line 8: i must be a whole number from 1 on, not '0'"),
        ("0 1 2 2 2.0", "0 1 1 1 2.0", "line 8: this entry was given before"),
        ("1 2 1 1 1.0", "1 2 1 1 1e400", "line 12: the value must be a finite number"),
    ],
)
def test_a_malformed_file_names_its_line(tmp_path, old, new, message):
    file = written(tmp_path, DIAGONAL.replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        read_sdpa(file)


def test_entries_below_the_diagonal_count_for_those_above(tmp_path):
    upper = "1\n1\n2\n1\n0 1 1 2 1\n1 1 1 1 1\n1 1 2 2 1\n"
    lower = upper.replace("0 1 1 2 1", "0 1 2 1 1")
    forms = [read_sdpa(written(tmp_path, text)).form for text in (upper, lower)]
    assert (forms[0].b == forms[1].b).all()
    with pytest.raises(InputError, match="given before"):
        read_sdpa(written(tmp_path, upper + "0 1 2 1 1\n"))


def test_a_file_that_ends_or_is_none(tmp_path):
    with pytest.raises(InputError, match="ends at line 2; needed is the sizes of the blocks"):
        read_sdpa(written(tmp_path, "1\n1\n"))
    with pytest.raises(InputError, match="no such file"):
        read_sdpa(tmp_path / "none.dat-s")
    (tmp_path / "x.dat-s").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(InputError, match="is no text"):
        read_sdpa(tmp_path / "x.dat-s")


@pytest.mark.parametrize("n", [30, pytest.param(50, marks=pytest.mark.slow)])
def test_bounds_of_larger_programs_are_exact(tmp_path, n):
    """Theta of a random graph, of 85 and 250 variables; the dual points are exact."""
    rng = np.random.default_rng(0)
    edges = [(i, j) for i in range(n) for j in range(i + 1, n) if rng.random() < 0.2]
    program = read_sdpa(written(tmp_path, of_graph(n, edges)))
    solution = wb.solve(program)
    assert solution.certificate.holds
    assert solution.certificate.gap.value >= 0.0
    # A claim that is 1e-4 better than the optimum lies below the exact bound of its dual point.
    better = solution.answer.assign(x=solution.answer["x"] * (1 - 1e-4))
    found = program.certify(better, 1e-6, optimal=True)
    assert not found.valid and not found.gap.closed
