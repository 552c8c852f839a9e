"""Sets and covers of the least mu of a loop: the mu of the kernel's bound, and a global optimum."""

import control
import numpy as np
import pytest
from lanes import thinned

import workbench as wb
from workbench.errors import InputError
from workbench.mu import upper_bound
from workbench.structure import Full, Structure
from workbench.uncertainty import (
    MatrixCover,
    MatrixModel,
    MatrixResponses,
    append,
    feedback,
    real,
)
from workbench.uncertainty.matrix_covers.sets.loop import loop_level
from workbench.uncertainty.matrix_covers.sets.program import FoundSets, MatrixSets

OMEGA = np.geomspace(1e-3, 1e2, 25)
SHAPES = ("full", "diagonal", "scalar")


def drawn(*shape, seed=0):
    real_, imaginary = np.random.default_rng(seed).normal(size=(2, *shape))
    return real_ + 1j * imaginary


def weighted(loop, left, right):
    """The loop between weights W_1 (F, p, p) and W_2 (F, m, m)."""
    m, p = right.shape[-1], left.shape[-1]
    N = loop.copy()
    N[:, :m] = right @ N[:, :m]
    N[:, :, :p] = N[:, :, :p] @ left
    return N


@pytest.mark.parametrize("shape", [(2, 2), (1, 3), (3, 1), (0, 0)])
def test_the_level_is_the_mu_of_two_full_blocks(shape):
    q, r = shape
    p, m = 3, 2
    loop = drawn(20, m + q, p + r, seed=2) * np.exp(drawn(20, 1, 1, seed=3))
    left, right = drawn(20, p, p, seed=4), drawn(20, m, m, seed=5)
    level, _ = loop_level(loop, np.linalg.inv(left), np.linalg.inv(right))
    blocks = [Full(p, m)] + ([Full(r, q)] if q else [])
    found = upper_bound(weighted(loop, left, right), Structure(tuple(blocks))).value
    np.testing.assert_allclose(np.exp(level), found, rtol=1e-6)


@pytest.mark.parametrize("left", SHAPES)
@pytest.mark.parametrize("right", SHAPES)
@pytest.mark.parametrize("performance", [(0, 0), (1, 1), (2, 1)])
def test_sets_of_least_mu_are_proven_and_cost_less_than_the_smallest_ones(left, right, performance):
    q, r = performance
    E, loop = drawn(3, 9, 3, 2), drawn(3, 2 + q, 3 + r, seed=1)
    program = MatrixSets(E, left=left, right=right, size="mu", loop=loop)
    solution = wb.solve(program)
    assert solution.certificate.holds, solution.certificate
    assert solution.certificate.gap.value <= 1e-6
    small = wb.solve(MatrixSets(E, left=left, right=right)).answer
    assert (program.log_mu(solution.answer) <= program.log_mu(small) + 1e-3).all()
    norms = np.linalg.norm(solution.answer.deltas(E), 2, axis=(2, 3))
    assert norms.max() <= 1 + 1e-9


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", range(3))
def test_no_weights_drawn_at_random_cost_less(seed):
    rng = np.random.default_rng(seed)
    program = MatrixSets(drawn(1, 5, 2, 2, seed=seed), size="mu", loop=drawn(1, 3, 3, seed=9))
    answer = wb.solve(program).answer
    least, away = np.log(program.sizes(answer)[0]), program.away(np.zeros((1, 2, 2)))
    for scale in np.geomspace(1e-4, 1.0, 200):
        turns = rng.normal(size=(2, 2, 2)) + 1j * rng.normal(size=(2, 2, 2))
        left, right = (np.eye(2) + scale * turn for turn in turns)
        W_1, W_2 = left @ answer.left[0], answer.right[0] @ right
        norm = np.linalg.norm(np.linalg.inv(W_1) @ away[0] @ np.linalg.inv(W_2), 2, axis=(1, 2))
        other = FoundSets(norm.max() * W_1[None], W_2[None], answer.centre, answer.weights)
        assert np.log(program.sizes(other)[0]) >= least - 1e-6


def test_a_bound_by_any_weights_is_below_what_any_cover_costs():
    rng = np.random.default_rng(5)
    program = MatrixSets(drawn(1, 6, 2, 2, seed=6), size="mu", loop=drawn(1, 3, 4, seed=7))
    answer = wb.solve(program).answer
    least = np.log(program.sizes(answer))
    for _ in range(50):
        proof = answer.of_loop.copy()
        proof[:, 1] += rng.normal()
        proof[:, 2:] *= rng.uniform(0, 2, proof[:, 2:].shape)
        weights = answer.weights * rng.uniform(0, 2, answer.weights.shape)
        other = FoundSets(1.3 * answer.left, answer.right, answer.centre, weights, proof)
        bound = np.log(program.sizes(other)) - program.excess(other)
        assert (bound <= least + 1e-9).all()
    unproven = FoundSets(answer.left, answer.right, answer.centre, answer.weights)
    assert not program.certify(unproven, 1e-6, optimal=True).gap.closed


HARD = {
    "one matrix": (drawn(2, 1, 2, 2), drawn(2, 3, 3, seed=1)),
    "one direction": (drawn(2, 9, 1, 1) * drawn(2, 1, 2, 1) @ drawn(2, 1, 1, 2), drawn(2, 3, 3)),
    "graded": (
        np.diag([1.0, 1e-8]) @ drawn(2, 9, 2, 2) @ np.diag([1.0, 1e5]),
        drawn(2, 3, 3, seed=1),
    ),
    "tiny": (1e-100 * drawn(2, 9, 2, 2), drawn(2, 3, 3, seed=1)),
    "huge": (1e100 * drawn(2, 9, 2, 2), drawn(2, 3, 3, seed=1)),
    "loop of rank one": (drawn(2, 9, 2, 2), drawn(2, 3, 1) @ drawn(2, 1, 3, seed=1)),
    "performance far from the sets": (
        drawn(2, 9, 2, 2),
        drawn(2, 3, 3, seed=1) * np.array([1.0, 1.0, 1e-8]),
    ),
    "no loop about the sets": (
        drawn(2, 9, 2, 2),
        drawn(2, 3, 3) * np.array([[0, 0, 1], [0, 0, 1], [1, 1, 1]]),
    ),
    "graded loop": (
        drawn(2, 9, 2, 2),
        np.diag([1, 1e6, 1]) @ drawn(2, 3, 3) @ np.diag([1e-6, 1, 1]),
    ),
}


@pytest.mark.parametrize("name", HARD)
def test_hard_matrices_and_loops_have_proven_sets(name):
    E, loop = HARD[name]
    solution = wb.solve(MatrixSets(E, size="mu", loop=loop))
    assert solution.certificate is not None, solution.message
    assert solution.certificate.holds, solution.certificate
    assert solution.certificate.gap.value <= 1e-6


def test_an_answer_comes_back_from_its_dataset():
    program = MatrixSets(drawn(2, 4, 2, 3), size="mu", loop=drawn(2, 4, 3))
    answer = wb.solve(program).answer
    back = program.from_dataset(program.to_dataset(answer))
    np.testing.assert_array_equal(back.of_loop, answer.of_loop)
    np.testing.assert_array_equal(program.excess(back), program.excess(answer))


def column(a=0.0, b=0.0):
    """Two compositions of a distillation column by two flows of uncertain gain."""
    gains = np.array([[0.878, -0.864], [1.082, -1.096]]) @ np.diag([1 + a, 1 + b])
    return control.ss(
        control.combine_tf([[control.tf([g], [75, 1]) for g in row] for row in gains])
    )


def loop_of(form, weight=0.5):
    K = control.ss(control.tf([11.25, 0.15], [1, 1e-5])) * np.diag([1.0, -1.0])
    W = weight * control.append(*[control.ss(control.tf([10, 1], [10, 1e-5]))] * 2)
    return W * feedback(np.eye(2), MatrixModel.unweighted(column(), form=form) * K)


def plants():
    draws = np.random.default_rng(1).uniform(-0.2, 0.2, (12, 2))
    return MatrixResponses.of_systems([column(*draw) for draw in draws], OMEGA)


def cover(form="additive", performance=True, **changes):
    shapes = {"left_order": 1, "right_order": 1} | changes
    return MatrixCover(
        plants(), column(), form=form, loop=loop_of(form), performance=performance, **shapes
    )


@pytest.mark.slow
@pytest.mark.parametrize("form", ["additive", "input", "output"])
@pytest.mark.parametrize("performance", thinned([True, False], 2))
def test_covers_cost_about_as_little_as_sets_of_any_weights(form, performance):
    program = cover(form, performance)
    solution = wb.solve(program)
    assert solution.certificate.holds, solution.certificate
    metrics = solution.metrics
    assert metrics["mu_peak"] <= 1.02 * metrics["mu_peak_least"]
    small = wb.solve(program.without_loop(), method="descent").answer
    assert program.objective(solution.answer) <= program.objective(small) + 1e-6


@pytest.mark.slow
def test_full_weights_leave_the_loop_much_more_robust_than_diagonal_ones():
    """The column is ill-conditioned: what its outputs do together is what its inputs can do."""
    diagonal = wb.solve(cover(performance=False)).metrics["mu_peak"]
    program = cover(performance=False, left="full", right="full")
    full = wb.solve(program, method="steps")
    assert full.certificate.holds, full.certificate
    assert full.metrics["mu_peak"] <= 0.05 * diagonal


def test_its_mu_is_that_of_the_loop_with_the_found_model():
    program = cover("output")
    model = wb.solve(program, method="steps").answer.model
    K = control.ss(control.tf([11.25, 0.15], [1, 1e-5])) * np.diag([1.0, -1.0])
    W = 0.5 * control.append(*[control.ss(control.tf([10, 1], [10, 1e-5]))] * 2)
    loop = W * feedback(np.eye(2), model * K)
    N = np.array([loop.system(1j * w) for w in OMEGA])
    structure = Structure((Full(2, 2), Full(2, 2)))
    np.testing.assert_allclose(
        np.exp(program.log_mu(model)), upper_bound(N, structure).value, rtol=1e-5
    )


@pytest.mark.cases(0)
def test_figures_show_mu_beside_the_least_one_and_answers_come_back():
    program = cover()
    answer = wb.solve(program, method="steps").answer
    assert set(program.figures(answer)) == {"mu", "magnitudes", "radius", "deltas"}
    back = program.from_dataset(program.to_dataset(answer))
    assert program.objective(back) == pytest.approx(program.objective(answer), rel=1e-9)


E, LOOP = drawn(2, 3, 2, 2), drawn(2, 3, 3)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"loop": None}, "needs a loop"),
        ({"size": "volume"}, "needs a loop"),
        ({"centre": "free"}, "around the nominal"),
        ({"loop": drawn(3, 3, 3)}, r"\(F, m \+ q, p \+ r\)"),
        ({"loop": drawn(2, 1, 3)}, r"\(F, m \+ q, p \+ r\)"),
        ({"loop": drawn(2, 2, 3)}, "both 0 or neither"),
        ({"loop": "closed"}, "numbers"),
        ({"loop": np.full((2, 3, 3), np.nan)}, "finite"),
        ({"loop": np.zeros((2, 2, 2))}, "no path from w"),
        ({"loop": LOOP * np.array([1, 1, 0])}, "no path from w"),
    ],
)
def test_bad_loops_of_sets_are_named(changes, words):
    with pytest.raises(InputError, match=words):
        MatrixSets(**({"deviations": E, "size": "mu", "loop": LOOP} | changes))


@pytest.mark.parametrize(
    ("loop", "words"),
    [
        (column(), "StateSpace"),
        (feedback(real("k", 1.0, percent=10) * column(), np.eye(2)), "one full block of 2 x 2"),
        (append(MatrixModel.unweighted(column()), real("k", 1.0, percent=10)), "full block"),
        (MatrixModel.unweighted(column()) * control.ss(control.tf([1], [1, -1])), "unstable"),
        (0.0 * loop_of("additive"), "it has none"),
    ],
)
def test_bad_loops_of_covers_are_named(loop, words):
    with pytest.raises(InputError, match=words):
        MatrixCover(plants(), column(), loop=loop)


def test_other_bad_input_is_named():
    with pytest.raises(InputError, match="take the method descent"):
        wb.solve(cover(), method="joint")
    with pytest.raises(InputError, match="performance is 1"):
        cover(performance=1)
    with pytest.raises(InputError, match="no loop"):
        smallest = cover().without_loop()
        smallest.log_mu(MatrixModel.unweighted(smallest.nominal))
