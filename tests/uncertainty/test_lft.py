"""LFT algebra against plain arithmetic, and reduction against no reduction."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.uncertainty.algebra.lft import LFT, block_matrix, inverse, left_divide, lift, scalar
from workbench.uncertainty.algebra.reduction import grouped, reduced

NOMINALS = {"a": (2.0, 0.3), "b": (-0.5, 0.2), "c": (3e-4, 1e-4)}
SCALARS = {name: scalar(name, *values) for name, values in NOMINALS.items()}
DELTAS = st.fixed_dictionaries({name: st.floats(-1.0, 1.0) for name in NOMINALS})


def plain(deltas):
    return {name: m + d * deltas[name] for name, (m, d) in NOMINALS.items()}


def close(value, expected, rtol=1e-10):
    expected = np.atleast_2d(np.asarray(expected, dtype=float))
    assert value.shape == expected.shape
    np.testing.assert_allclose(value, expected, rtol=rtol, atol=rtol * abs(expected).max())


EXPRESSIONS = {
    "sum": lambda a, b, c: 1.0 + a - 2 * b + c / 3 - (4.0 - c),
    "product": lambda a, b, c: a * b * -c,
    "powers": lambda a, b, c: a**3 - b**-2 + c**0,
    "quotient": lambda a, b, c: (a - b) / (a + c) - 1 / c,
    "outer": lambda a, b, c: a * np.array([[1.0], [2.0]]) @ block_matrix([[b, c]]),
    "object array": lambda a, b, c: np.array([[a, 0], [1.0, b]], dtype=object) @ np.eye(2),
    "object times": lambda a, b, c: np.array([[a, c], [1.0, b]]) * a + np.array([[b, b], [a, 0]]),
    "array on the left": lambda a, b, c: np.array([[1.0, 2.0]]) @ block_matrix([[a, b], [c, 3]]),
    "array plus": lambda a, b, c: (
        np.ones((2, 2)) + block_matrix([[a, b], [c, 0]]) - np.float64(2) * a
    ),
    "left_divide": lambda a, b, c: left_divide(block_matrix([[a, 1.0], [b, c]]), [[c], [1.0]]),
    "inverse": lambda a, b, c: block_matrix([[a, 1.0], [b, c]]) @ inverse([[a, b], [1.0, a]]),
    "blocks": lambda a, b, c: block_matrix(
        [[np.eye(2), a * np.ones((2, 1))], [np.ones((1, 2)), b / c]]
    ),
    "zero": lambda a, b, c: 0 * a + b * np.zeros((2, 2)),
}


@pytest.mark.parametrize("name", EXPRESSIONS)
@given(DELTAS)
@settings(derandomize=True, deadline=None, max_examples=10)
def test_algebra_is_arithmetic(name, deltas):
    expression = EXPRESSIONS[name]
    value = lift(expression(**SCALARS))
    expected = np.asarray(expression(**plain(deltas)), dtype=float)
    close(value(deltas), expected)
    small = reduced(value)
    assert len(small.names) <= len(value.names)
    close(small(deltas), expected)


def trees():
    """Rational expressions as nested tuples; denominators stay away from zero."""
    leaves = st.one_of(st.sampled_from(list(NOMINALS)), st.sampled_from([1.0, -2.0, 0.5]))
    return st.recursive(
        leaves,
        lambda inner: st.one_of(
            st.tuples(st.sampled_from("+-*/"), inner, inner),
            st.tuples(st.just("^"), inner, st.integers(0, 3)),
            st.tuples(st.just("left_divide"), inner, inner),
        ),
        max_leaves=8,
    )


def evaluate(tree, values, terms):
    """The tree at `values`; what it meets on the way goes to `terms`."""
    if not isinstance(tree, tuple):
        return values.get(tree, tree)
    operation, first, second = tree
    x = evaluate(first, values, terms)
    y = second if operation == "^" else evaluate(second, values, terms)
    if operation == "^":
        result = x**y
    elif operation == "left_divide":  # [1 x; -x 1 + y^2] has the determinant 1 + x^2 + y^2
        a = block_matrix([[1.0, x], [-x, 1.0 + y * y]])
        result = np.array([[1.0, 0.0]]) @ left_divide(a, block_matrix([[x], [1.0]]))
    elif operation == "/":
        result = x / (1.0 + y * y)
    else:
        result = {"+": x + y, "-": x - y, "*": x * y}[operation]
    terms.append(result)
    return result


@given(trees(), DELTAS)
@settings(derandomize=True, deadline=None, max_examples=60)
def test_random_expressions(tree, deltas):
    value, terms = lift(evaluate(tree, SCALARS, [])), [1.0]
    corners = [dict.fromkeys(NOMINALS, delta) for delta in (-1.0, 0.0, 1.0)]
    for at in (*corners, deltas):
        expected = evaluate(tree, plain(at), terms)
    error = 1e-10 * max(np.max(np.abs(term)) for term in terms) ** 2
    assert abs(value(deltas) - expected).max() <= error
    assert abs(reduced(value)(deltas) - expected).max() <= error


@given(
    st.integers(1, 6), st.integers(1, 3), st.integers(0, 3), st.integers(-9, 9), st.integers(0, 999)
)
@settings(derandomize=True, deadline=None, max_examples=40)
def test_reduction_finds_what_is_hidden(n, size, extra, decades, seed):
    """Channels that do nothing, hidden by a change of coordinates and of units, are found."""
    rng = np.random.default_rng(seed)
    core = rng.standard_normal((n + size, n + size)) / n
    hidden = np.zeros((n + 2 * extra + size,) * 2)
    keep = [*range(n), *range(n + 2 * extra, n + 2 * extra + size)]
    hidden[np.ix_(keep, keep)] = core
    r = n + 2 * extra
    hidden[n : n + extra, :] = rng.standard_normal((extra, hidden.shape[1]))
    hidden[:, n + extra : r] = rng.standard_normal((hidden.shape[0], extra))
    hidden[n : n + extra, n + extra : r] = hidden[n + extra : r, n : n + extra] = 0.0
    hidden[:r, :r] /= r
    T = np.linalg.qr(rng.standard_normal((r, r)))[0]
    hidden[:r] = T @ hidden[:r]
    hidden[:, :r] = hidden[:, :r] @ T.T
    hidden[r:] *= 10.0**decades
    lft = LFT(hidden, ("a",) * r)
    small = reduced(lft)
    assert len(small.names) <= min(n, r)
    for delta in (-0.3, 0.2):
        close(small({"a": delta}), lft({"a": delta}), 1e-9)


def test_repetitions_of_known_expressions():
    a, b = SCALARS["a"], SCALARS["b"]
    counts = {
        "a": lift(a + a + a),
        "aa": a * a,
        "": a - a,
        "ab": (a + b) / (1 + 0 * a),
        "aab": (a**2 + b) / 1.0,
        "b": b / b * b,
    }
    for expected, value in counts.items():
        names = reduced(value).names
        assert "".join(sorted(names)) == expected


def test_repeated_matrices_need_their_rank():
    a = SCALARS["a"]
    assert (a * np.ones((3, 3))).repetitions() == {"a": 3}
    assert reduced(a * np.ones((3, 3))).repetitions() == {"a": 1}
    assert reduced(a * np.diag([1e9, 1e-9, 0.0])).repetitions() == {"a": 2}


def test_kept_scalars_keep_their_channels():
    value = SCALARS["a"] + SCALARS["a"] + SCALARS["b"] + SCALARS["b"]
    assert reduced(value, keep=("b",)).repetitions() == {"a": 1, "b": 2}
    assert grouped(value, ["b", "a"]).names == ("b", "b", "a", "a")


def test_a_batch_of_values():
    value = SCALARS["a"] / SCALARS["c"]
    a, c = np.linspace(-1, 1, 3)[:, None], np.linspace(-1, 1, 4)
    result = value({"a": a, "c": c})
    assert result.shape == (3, 4, 1, 1)
    np.testing.assert_allclose(result[..., 0, 0], (2 + 0.3 * a) / (3e-4 + 1e-4 * c))


def test_singular_somewhere():
    value = 1 / (SCALARS["a"] - 2.3)
    with pytest.raises(InputError, match="delta of a = 1"):
        value({"a": np.array([0.0, 1.0])})


@pytest.mark.parametrize(
    "bad, message",
    [
        (lambda a: 1 / (a - a), "singular at the nominal"),
        (lambda a: a / block_matrix([[a, 1.0], [1.0, a]]), "use left_divide"),
        (lambda a: inverse([[a, a], [a, a]]), "singular at the nominal"),
        (lambda a: inverse([[a, a]]), "square"),
        (lambda a: left_divide(np.zeros((2, 2)), np.eye(2)), "singular at the nominal"),
        (lambda a: a**0.5, "integer powers"),
        (lambda a: block_matrix([[a, a], [a, a]]) ** 2, "integer powers"),
        (lambda a: block_matrix([[a, a]]) * block_matrix([[a, a]]), "use @"),
        (lambda a: block_matrix([[a, a]]) @ block_matrix([[a, a]]), "product of matrices"),
        (lambda a: block_matrix([[a, a]]) + block_matrix([[a, a], [a, a]]), "sum of matrices"),
        (lambda a: block_matrix([[a, np.eye(2)]]), "beside"),
        (lambda a: block_matrix([[a], [np.eye(2)]]), "below"),
        (lambda a: lift([a, a]), "column"),
        (lambda a: 1j * a, "real numbers"),
    ],
)
def test_what_is_no_arithmetic(bad, message):
    with pytest.raises(InputError, match=message):
        bad(SCALARS["a"])
