"""Isolation by signatures and by clusters."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from workbench.diagnosis import (
    AMBIGUOUS,
    NO_FAULT,
    UNKNOWN,
    Clusters,
    confusion_matrix,
    isolable,
    isolate,
)
from workbench.errors import InputError

GENERALISED = ~np.eye(4, dtype=bool)


@pytest.mark.parametrize("structure", [np.eye(4, dtype=bool), GENERALISED])
def test_each_fault_is_found_by_its_own_signature(structure):
    assert isolable(structure)
    assert isolate(structure, structure.T).tolist() == [0, 1, 2, 3]


def test_nothing_fired_and_two_as_near():
    fired = np.array([[0, 0, 0], [1, 1, 0]], bool)
    assert isolate(np.eye(3, dtype=bool), fired).tolist() == [NO_FAULT, AMBIGUOUS]
    # In the generalised scheme one residual that stays out still leaves two as near.
    assert isolate(GENERALISED, np.array([[1, 1, 0, 0]], bool)).tolist() == [AMBIGUOUS]


@given(st.integers(0, 2), st.integers(0, 5))
def test_one_wrong_residual_is_mended_when_signatures_are_three_apart(fault, wrong):
    signatures = [[1, 1, 1, 0, 0, 0], [0, 0, 0, 1, 1, 1], [1, 0, 1, 1, 0, 1]]
    structure = np.array(signatures, bool).T
    fired = structure.T[[fault]].copy()
    fired[0, wrong] ^= True
    assert isolate(structure, fired).tolist() == [fault]


def test_structures_that_do_not_isolate():
    assert not isolable(np.array([[True, True]]))
    assert not isolable(np.array([[True, False]]))
    with pytest.raises(InputError, match="bool"):
        isolable(np.eye(2))
    with pytest.raises(InputError, match=r"must be \(N, 4\) of bool"):
        isolate(GENERALISED, np.ones((2, 3), bool))


@pytest.fixture(scope="module")
def clouds():
    rng = np.random.default_rng(2)
    shapes = [np.diag([1.0, 4.0]), np.array([[2.0, 1.2], [1.2, 1.0]]), 0.3 * np.eye(2)]
    centres = [(0.0, 0.0), (6.0, 0.0), (0.0, 9.0)]
    points = [rng.multivariate_normal(c, s, 400) for c, s in zip(centres, shapes, strict=True)]
    return np.vstack(points), np.repeat(np.arange(3), 400)


def test_the_likeliest_kind_is_scipys(clouds):
    points, labels = clouds
    clusters = Clusters.fit(points, labels, ("a", "b", "c"))
    parts = [points[labels == k] for k in range(3)]
    likelihood = [multivariate_normal(p.mean(axis=0), np.cov(p.T)).logpdf(points) for p in parts]
    found = clusters.classify(points)
    assert found.tolist() == np.argmax(likelihood, axis=0).tolist()
    counts = confusion_matrix(labels, found, 3)
    assert counts.sum() == 1200
    assert np.trace(counts[:, :3]) > 1170
    assert (counts.sum(axis=1) == 400).all()


def test_far_points_are_unknown(clouds):
    clusters = Clusters.fit(*clouds, ("a", "b", "c"))
    far = np.array([[40.0, 40.0], [0.0, 0.0]])
    assert clusters.classify(far).tolist() != [UNKNOWN, 0]
    assert clusters.classify(far, reject=1e-3).tolist() == [UNKNOWN, 0]
    share = np.mean(clusters.classify(clouds[0], reject=0.05) == UNKNOWN)
    assert 0.0 < share <= 0.06


@settings(max_examples=30, deadline=None)
@given(st.floats(-3, 3), st.floats(0.1, 10))
def test_classes_do_not_depend_on_units(shift, scale):
    rng = np.random.default_rng(4)
    labels = np.repeat([0, 1], 30)
    points = rng.standard_normal((60, 2)) + np.outer(labels, [2.0, 1.0])
    before = Clusters.fit(points, labels, "ab").distances(points)
    moved = points * [scale, 1.0] + [shift, 0.0]
    assert Clusters.fit(moved, labels, "ab").distances(moved) == pytest.approx(before, rel=1e-6)


def test_singular_clusters_are_named():
    rng = np.random.default_rng(5)
    points, labels = rng.standard_normal((20, 2)), np.repeat([0, 1], 10)
    with pytest.raises(InputError, match=r"'b'.* from 2 samples; at least 3 needed"):
        Clusters.fit(points[:12], labels[:12], ("a", "b"))
    still = points.copy()
    still[10:, 1] = 7.0
    with pytest.raises(InputError, match=r"'b': singular .* features \[1\] do not vary"):
        Clusters.fit(still, labels, ("a", "b"))
    flat = points.copy()
    flat[:10, 1] = 2.0 * flat[:10, 0] - 1.0
    with pytest.raises(InputError, match=r"'a': singular .* combination"):
        Clusters.fit(flat, labels, ("a", "b"))


def test_lengths_and_numbers_that_do_not_match():
    with pytest.raises(InputError, match="3 features and 2 labels"):
        Clusters.fit(np.ones((3, 1)), [0, 0], "a")
    with pytest.raises(InputError, match="labels"):
        Clusters.fit(np.ones((2, 1)), [0, 1], "a")
    with pytest.raises(InputError, match="finite"):
        Clusters.fit([[np.nan]], [0], "a")
    with pytest.raises(InputError, match="equally many"):
        confusion_matrix([0, 1], [0], 2)
    with pytest.raises(InputError, match="found"):
        confusion_matrix([0], [5], 2)
