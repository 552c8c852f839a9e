import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from workbench.geometry.exact_circle import exact_circle
from workbench.geometry.exact_stadium import exact_stadium, stadium_radius

EPS = np.finfo(float).eps
CASES = ["free", "centre", "angle", "both"]
# multiples of 1/64: moved by 100 without rounding
coordinates = st.one_of(st.integers(-3, 3), st.integers(-512, 512).map(lambda k: k / 64))
point_sets = st.lists(st.builds(complex, coordinates, coordinates), min_size=1, max_size=12).map(
    np.array
)


def random_set(rng, kind, count):
    normal = rng.normal(size=count) + 1j * rng.normal(size=count)
    match kind:
        case "normal":
            return normal
        case "duplicated":
            return normal[rng.integers(0, 2 + count // 3, count).clip(max=count - 1)]
        case "long":
            thin = normal.real + 1j * normal.imag * 10 ** rng.uniform(-5, -1)
            return thin * np.exp(1j * rng.uniform(0, 2 * np.pi))
        case "on a circle":
            return np.exp(1j * rng.uniform(0, 2 * np.pi, count))
        case "grid":
            return np.round(2 * normal)


def given_in(case, rng, points):
    chosen = {}
    if case in ("centre", "both"):
        away = rng.choice([0.0, 1.0, 30.0]) * np.exp(1j * rng.uniform(0, 7))
        chosen["center"] = points.mean() + away
    if case in ("angle", "both"):
        chosen["angle"] = rng.uniform(-7, 7)
    return chosen


def excess(points, center, radius, half_length, angle):
    """The largest distance from the segment, less the radius, in extended precision."""
    away = points.astype(np.clongdouble) - center
    c, s = np.cos(np.longdouble(angle)), np.sin(np.longdouble(angle))
    along, across = c * away.real + s * away.imag, c * away.imag - s * away.real
    beyond = np.maximum(np.abs(along) - np.longdouble(half_length), 0)
    return float(np.max(np.hypot(beyond, across) - np.longdouble(radius)))


def strip_radius(points, angle, center=None):
    across = (np.multiply.outer(np.exp(-1j * np.asarray(angle)), points)).imag
    if center is None:
        return np.ptp(across, axis=-1) / 2
    middle = (np.exp(-1j * np.asarray(angle)) * center).imag
    return np.abs(across - middle[..., None]).max(axis=-1)


def scanned_radius(points, center=None):
    """The least radius on a fine scan of the angle, refined at its three best local minima."""
    angles = np.linspace(0, np.pi, 2000, endpoint=False)
    radii = strip_radius(points, angles, center)
    low = np.flatnonzero((radii <= np.roll(radii, 1)) & (radii <= np.roll(radii, -1)))
    best = radii.min()
    for k in low[np.argsort(radii[low])[:3]]:
        refined = minimize_scalar(
            lambda angle: strip_radius(points, angle, center),
            bounds=(angles[k] - np.pi / 2000, angles[k] + np.pi / 2000),
            method="bounded",
            options={"xatol": 1e-13},
        )
        best = min(best, refined.fun)
    return best


@pytest.mark.parametrize("kind", ["normal", "duplicated", "long", "on a circle", "grid"])
@pytest.mark.parametrize("case", ["free", "centre"])
def test_never_wider_than_a_scan(kind, case):
    rng = np.random.default_rng(11)
    for count in rng.integers(3, 60, 80):
        points = random_set(rng, kind, count)
        chosen = given_in(case, rng, points)
        center, radius, _, angle = exact_stadium(points, **chosen)
        reference = scanned_radius(points, **chosen)
        rounding = 8 * EPS * np.abs(points - center).max()
        assert radius <= reference * (1 + 1e-9) + rounding
        # and its own angle is no worse than it says
        assert radius == pytest.approx(strip_radius(points, angle, **chosen), 1e-9, rounding)


@pytest.mark.parametrize("kind", ["normal", "duplicated", "long", "on a circle", "grid"])
@pytest.mark.parametrize("case", CASES)
def test_holds_its_points_and_is_no_longer_than_it_must(kind, case):
    rng = np.random.default_rng(12)
    for count in rng.integers(1, 60, 200):
        points = random_set(rng, kind, count)
        chosen = given_in(case, rng, points)
        center, radius, half_length, angle = exact_stadium(points, **chosen)
        assert excess(points, center, radius, half_length, angle) <= 0
        assert 0 <= angle < np.pi
        if "center" in chosen:
            assert center == chosen["center"]
        if "angle" in chosen:
            assert np.exp(2j * angle) == pytest.approx(np.exp(2j * chosen["angle"]), abs=1e-14)
        cut = 1e-3 * half_length
        if half_length > 1e-3 * radius:
            moves = [0.0] if "center" in chosen else [-1.0, 1.0]
            for move in moves:
                moved = center + move * cut * np.exp(1j * angle)
                assert stadium_radius(points, moved, half_length - cut, angle[()]) > radius


def test_radius_of_a_given_stadium():
    points = np.array([3 + 4j, 0])
    for half_length, angle, radius in ((0.0, 0.3, 5), (3.0, 0.0, 4), (4.0, np.pi / 2, 3)):
        found = stadium_radius(points, 0j, half_length, angle)
        assert radius <= found <= radius * (1 + 1e-14)


@pytest.mark.parametrize("case", CASES)
def test_batch_broadcasts(case):
    rng = np.random.default_rng(13)
    points = rng.normal(size=(3, 1, 7)) + 1j * rng.normal(size=(3, 1, 7))
    chosen = {}
    if case in ("centre", "both"):
        chosen["center"] = rng.normal(size=4) + 0j
    if case in ("angle", "both"):
        chosen["angle"] = rng.normal(size=(3, 1))
    shape = (3, 4) if "center" in chosen else (3, 1)
    answers = exact_stadium(points, **chosen)
    assert all(answer.shape == shape for answer in answers)
    for i, j in np.ndindex(*shape):
        one = {name: np.broadcast_to(value, shape)[i, j] for name, value in chosen.items()}
        single = exact_stadium(points[i, 0], **one)
        assert [answer[i, j] for answer in answers] == [
            float(a) if a.dtype == float else a for a in single
        ]


@pytest.mark.parametrize(
    ("points", "chosen", "expected"),
    [
        ([2 + 1j], {}, (2 + 1j, 0, 0, 0)),
        ([2 + 1j] * 5, {}, (2 + 1j, 0, 0, 0)),
        ([2 + 1j] * 5, {"angle": -1}, (2 + 1j, 0, 0, np.pi - 1)),
        ([2 + 1j] * 5, {"center": 2 + 1j}, (2 + 1j, 0, 0, 0)),
        ([3 + 4j] * 5, {"center": 0}, (0, 0, 5, np.arctan2(4, 3))),
        ([0j, 2j], {}, (1j, 0, 1, np.pi / 2)),
        ([0j, 2j], {"angle": 0}, (1j, 1, 0, 0)),
        ([0j, 2j], {"center": 1, "angle": 0}, (1, 2, 1, 0)),
        ([0j, 1 + 1j, 3 + 3j, 3 + 3j], {}, (1.5 + 1.5j, 0, np.sqrt(4.5), np.pi / 4)),
        ([1e8, 1e8 + 1, 1e8 + 4], {}, (1e8 + 2, 0, 2, 0)),
        ([0j, 4, 4 + 2j, 2j], {}, (2 + 1j, 1, 2, 0)),
        (
            [0j, 2, 1 + 1j, 1 - 1j, 6 + 0.5j],
            {"center": 1, "angle": 0},
            (1, 1, 5 - np.sqrt(0.75), 0),
        ),
    ],
)
def test_known_answers(points, chosen, expected):
    points = np.array(points)
    found = exact_stadium(points, **chosen)
    size = np.abs(points - expected[0]).max()
    for value, wanted, scale in zip(found, expected, (1, size, size, 1), strict=True):
        assert value == pytest.approx(wanted, rel=0, abs=8 * EPS * max(scale, 0.1))
    assert excess(points, *found) <= 0


@pytest.mark.parametrize("count", [3, 4, 5, 6, 8, 9, 1000])
@pytest.mark.parametrize("turned", [0.0, 0.2])
def test_regular_polygons(count, turned):
    """All edges tie. The width is known, and the half-length is that of an edge's direction."""
    corners = 2 + np.exp(1j * (turned + 2 * np.pi * np.arange(count) / count))
    inner = np.cos(np.pi / count)
    _, radius, half_length, _ = exact_stadium(corners)
    assert radius == pytest.approx(inner if count % 2 == 0 else (1 + inner) / 2, rel=1e-14)
    edge = np.angle(corners[1] - corners[0])
    assert half_length == pytest.approx(exact_stadium(corners, angle=edge)[2], abs=1e-7)


@pytest.mark.parametrize("turned", [0.0, 0.7])
def test_ties_in_width_go_to_the_shorter(turned):
    # as wide as high, with long edges along x: lying along x the stadium is the longer one
    quarter = np.array([0.9 + 1j, 1 + 0.1j])
    points = np.concatenate([quarter, quarter.conj(), -quarter, -quarter.conj()])
    points = points * np.exp(1j * turned)
    lying, standing = (exact_stadium(points, angle=turned + a) for a in (0, np.pi / 2))
    assert lying[1] == pytest.approx(standing[1], rel=1e-14)
    assert lying[2] == pytest.approx(0.9, abs=1e-7)
    found = exact_stadium(points)
    assert found[1] == pytest.approx(1, rel=1e-14)
    assert found[2] == pytest.approx(1 - np.sqrt(0.19), abs=1e-7)
    assert found[3] == pytest.approx(turned + np.pi / 2, abs=1e-14)


@pytest.mark.parametrize("exponent", [-1060, -1000, -500, 500, 1000, 1020])
@pytest.mark.parametrize("case", CASES)
def test_extreme_scales(exponent, case):
    points = np.array([1, -1 + 0.5j, 1j, -0.25j])
    chosen = {}
    if case in ("centre", "both"):
        chosen["center"] = 0.5 + 0.25j
    if case in ("angle", "both"):
        chosen["angle"] = 1.0

    def scaled(values):
        return np.ldexp(np.real(values), exponent) + 1j * np.ldexp(np.imag(values), exponent)

    near = exact_stadium(points, **chosen)
    if "center" in chosen:
        chosen["center"] = scaled(chosen["center"])
    far = exact_stadium(scaled(points), **chosen)
    close = 1e-3 if exponent < -1050 else 1e-14
    assert far[1] == pytest.approx(np.ldexp(near[1], exponent), rel=close)
    assert far[2] == pytest.approx(np.ldexp(near[2], exponent), rel=close)
    assert far[3] == near[3]
    assert excess(scaled(points), *far) <= 0


@given(point_sets, st.sampled_from(CASES), st.randoms(use_true_random=False))
def test_invariance(points, case, random):
    chosen = given_in(case, np.random.default_rng(random.randrange(2**32)), points)
    if "center" in chosen:
        chosen["center"] = np.round(64 * chosen["center"]) / 64
    center, radius, half_length, angle = exact_stadium(points, **chosen)
    size = np.abs(points - center).max() + np.abs(points).max()

    def found(moved, move_center, move_angle):
        moves = {"center": move_center, "angle": move_angle}
        return exact_stadium(moved, **{name: moves[name](chosen[name]) for name in chosen})

    shuffled = np.array(random.sample(points.tolist(), points.size))
    assert found(shuffled, lambda c: c, lambda a: a) == (center, radius, half_length, angle)
    double = found(points * 2.0**40, lambda c: c * 2.0**40, lambda a: a)
    assert double[0] == center * 2.0**40
    assert double[2:] == (half_length * 2.0**40, angle)
    # the same arithmetic, but for the outward rounding of distances, which is absolute
    assert double[1] == pytest.approx(radius * 2.0**40, rel=1e-14, abs=8 * EPS * size * 2.0**40)
    turn = random.uniform(-3, 3)
    moved = [
        found(points + 100, lambda c: c + 100, lambda a: a),
        found(points.conj(), np.conj, lambda a: -a),
        found(points * np.exp(1j * turn), lambda c: c * np.exp(1j * turn), lambda a: a + turn),
    ]
    for answer in moved:
        assert answer[1] == pytest.approx(radius, rel=1e-14, abs=8 * EPS * (size + 100))
        # a half-length goes with the root of the width's rounding
        assert answer[2] == pytest.approx(half_length, abs=2e-6 * size)


@given(point_sets)
def test_agreement_between_the_cases(points):
    center, radius, half_length, angle = exact_stadium(points)
    rounding = 16 * EPS * np.abs(points).max()
    assert radius <= exact_circle(points)[1] + rounding
    same = exact_stadium(points, angle=angle)
    assert same == (center, radius, half_length, angle)
    centered = exact_stadium(points, center=center)
    assert centered[1] == pytest.approx(radius, rel=1e-14, abs=rounding)
    both = exact_stadium(points, center=center, angle=angle)
    assert both[1] == pytest.approx(radius, rel=1e-14, abs=rounding)
    assert both[2] == pytest.approx(half_length, abs=1e-6 * np.abs(points).max())
