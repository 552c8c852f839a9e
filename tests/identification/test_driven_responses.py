"""Responses of plants in closed loops, by their excitation: regions that hold the plant."""

import numpy as np
import pytest
from simulated_loops import records_of, two_by_two, two_by_two_response

from workbench.errors import InputError
from workbench.identification import driven_response
from workbench.identification.responses.local_polynomial import polynomials_in_bands
from workbench.identification.responses.ratios import of_chosen, ratio_reach, seen

CONFIDENCE, LEAST = 0.95, 0.93
SIZES = (1.0, 3.0, 10.0)
"""Excitations over the deviation of the disturbance."""


def coverage(loop, excitation, size, records, seed, samples=2000, stated=None):
    """Share of all stated regions that hold the plant, and of records that are refused.

    ``stated`` is the period of an excitation that is not given.
    """
    rng = np.random.default_rng([seed, *excitation.encode(), *loop.encode(), int(10 * size)])
    u, y, r, plant = records_of(loop, excitation, size, samples, records, rng)
    held, refused = [], 0
    for k in range(records):
        try:
            found = driven_response(u[:, k], y[:, k], stated or r[:, k], 1.0)
        except InputError:
            refused += 1
            continue
        exact = plant(np.exp(1j * found.omega)).ravel()
        held.append(
            np.abs(found.response[:, 0, 0] - exact) <= found.radius(confidence=CONFIDENCE)[:, 0, 0]
        )
    return float(np.mean(np.concatenate(held))), refused / records


def open_coverage(loop, excitation, size, records, seed, samples=2000):
    """The same where the loop is taken as open."""
    rng = np.random.default_rng([seed, *excitation.encode(), *loop.encode(), int(10 * size)])
    u, y, _, plant = records_of(loop, excitation, size, samples, records, rng)
    held = []
    for k in range(records):
        found = polynomials_in_bands(u[:, [k]], y[:, [k]], 2, 14)
        exact = plant(np.exp(2j * np.pi * found.cycles_per_sample)).ravel()
        radius = np.sqrt(3.63 * found.variance[:, 0, 0])  # the 95 % quantile of F(2, 16)
        held.append(np.abs(found.response[:, 0, 0] - exact) <= radius)
    return float(np.mean(np.concatenate(held)))


@pytest.mark.cases(0)
@pytest.mark.parametrize("loop", ["lag", "resonance"])
@pytest.mark.parametrize("excitation", ["steps", "binary", "periodic"])
def test_regions_hold_the_plant_that_open_loop_estimates_miss(loop, excitation):
    held, refused = coverage(loop, excitation, 3.0, 12, seed=1)
    assert held >= LEAST and refused == 0
    assert open_coverage(loop, excitation, 3.0, 3, seed=1) < 0.9


@pytest.mark.cases(1)
@pytest.mark.parametrize("loop", ["lag", "resonance"])
def test_the_period_of_an_excitation_that_was_not_recorded_is_enough(loop):
    held, refused = coverage(loop, "periodic", 3.0, 12, seed=2, stated=256)
    assert held >= LEAST and refused == 0
    u, y, r, _ = records_of(loop, "periodic", 3.0, 2000, 1, np.random.default_rng(3))
    known, found = (driven_response(u[:, 0], y[:, 0], one, 1.0) for one in (r[:, 0], 256))
    both, one, other = np.intersect1d(known.frequency_hz, found.frequency_hz, return_indices=True)[
        :3
    ]
    assert both.size > 20
    np.testing.assert_allclose(known.response[one], found.response[other], rtol=1e-6)
    assert "outside: not recorded, and stated to repeat itself" in str(found.report.sentences)


@pytest.mark.slow
@pytest.mark.parametrize("loop", ["lag", "resonance"])
@pytest.mark.parametrize("size", SIZES)
def test_periods_alone_hold_the_plant_in_many_records(loop, size):
    held, refused = coverage(loop, "periodic", size, 300, seed=6363, stated=256)
    assert held >= LEAST and refused <= 3


def several_coverage(excitation, size, records, seed):
    """Share of the regions of an output that hold the responses from both inputs at once."""
    rng = np.random.default_rng([seed, *excitation.encode(), int(10 * size)])
    held = []
    for _ in range(records):
        if excitation == "periodic":
            runs = [two_by_two(excitation, size, 2000, rng, only=k) for k in range(2)]
            u, y, r = (np.stack(parts, axis=-1) for parts in zip(*runs, strict=True))
        else:
            u, y, r = two_by_two(excitation, size, 2000, rng)
        found = driven_response(u, y, r, 1.0)
        away = np.abs(found.response - two_by_two_response(found.frequency_hz))
        held.append((away <= found.radius(confidence=CONFIDENCE)).all(axis=2).ravel())
    return float(np.mean(np.concatenate(held)))


@pytest.mark.cases(1)
@pytest.mark.parametrize("excitation", ["binary", "periodic"])
def test_regions_of_several_inputs_hold_them_at_once(excitation):
    assert several_coverage(excitation, 10.0, 4, seed=1) >= LEAST


SEEN = [("steps", 10.0), *((kind, size) for kind in ("binary", "periodic") for size in (3.0, 10.0))]
"""Excitations and their sizes. Steps of size 3 are hardly seen; some such records are refused."""


@pytest.mark.slow
@pytest.mark.parametrize(("excitation", "size"), SEEN)
def test_regions_of_several_inputs_hold_them_in_many_records(excitation, size):
    assert several_coverage(excitation, size, 100, seed=6363) >= LEAST


def test_several_inputs_are_told_by_as_many_experiments_or_excitations():
    rng = np.random.default_rng(2)
    u, y, r = two_by_two("binary", 10.0, 2000, rng)
    one = driven_response(u, y, r, 1.0)
    assert one.response.shape[1:] == (2, 2) and one.spread.shape[1:] == (2, 2)
    assert repr(one).startswith("DrivenResponse: 2 outputs, 2 inputs, ")
    again = driven_response(u[:, ::-1], y, r @ [[1.0, 2.0], [0.5, -3.0]], 1.0)
    both = np.intersect1d(one.frequency_hz, again.frequency_hz, return_indices=True)[1:]
    np.testing.assert_allclose(one.response[both[0]], again.response[both[1]][..., ::-1], rtol=1e-6)
    tiled = np.tile(r[:250], (8, 1))
    for excitation, words in (
        (r[:, 0], "2 inputs and 1 excitations"),
        (tiled, "2 inputs and 1 experiments with a periodic excitation"),
        (250, "2 inputs and 1 experiments with a periodic excitation"),
        (np.stack([r, r[::-1]], axis=-1), "1 experiments in u and 2 in the excitation"),
    ):
        with pytest.raises(InputError, match=words):
            driven_response(u, y, excitation, 1.0)
    pair = [np.stack([x, x[::-1]], axis=-1) for x in (u, y, r)]
    with pytest.raises(InputError, match="do not repeat themselves alike"):
        driven_response(*pair, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("loop", ["lag", "resonance"])
@pytest.mark.parametrize("excitation", ["steps", "binary", "periodic"])
@pytest.mark.parametrize("size", SIZES)
def test_regions_hold_the_plant_in_many_records(loop, excitation, size):
    held, refused = coverage(loop, excitation, size, 1000, seed=63)
    assert held >= LEAST
    assert refused <= (0.2 if size == SIZES[0] else 0.0)


@pytest.mark.cases(1)
@pytest.mark.parametrize("excitation", ["steps", "binary"])
@pytest.mark.parametrize("size", [100.0, 1e4])
def test_bias_counts_where_there_is_hardly_any_noise(excitation, size):
    """Polynomials of degree 2 alone held 71 % of the steps' regions."""
    held, refused = coverage("lag", excitation, size, 6, seed=5)
    assert held >= LEAST and refused == 0


def test_a_region_is_all_ratios_that_are_compatible():
    rng = np.random.default_rng(3)
    y, u = rng.standard_normal((2, 200, 2)) @ [1, 1j] + 3
    root = 0.4 * rng.standard_normal((200, 2, 2, 2)) @ [1, 1j]
    C = root @ root.conj().swapaxes(1, 2)
    ratio, quantile = y / u, 3.0
    joint = C / np.abs(u[:, None, None]) ** 2
    confidence = 1 - (1 + 2 * quantile / 20) ** (-10)  # of F(2, 20) in closed form
    reach = ratio_reach(ratio, joint, np.array(20.0), np.array(confidence))
    turn = np.exp(2j * np.pi * np.arange(2000) / 2000)
    tried = ratio[:, None] + np.minimum(reach, 1e3)[:, None] * turn

    def compatible(G):
        spread = C[:, :1, 0].real - 2 * (G.conj() * C[:, :1, 1]).real
        spread = spread + np.abs(G) ** 2 * C[:, 1:, 1].real
        return np.abs(y[:, None] - G * u[:, None]) ** 2 / (quantile * spread)

    ended = np.isfinite(reach)
    least = compatible(tried).min(axis=1)[ended]
    assert 0 < ended.sum() < 200
    np.testing.assert_allclose(least, 1.0, rtol=1e-4)  # the disc touches the set from outside
    np.testing.assert_array_equal(ended, np.abs(u) ** 2 > quantile * C[:, 1, 1].real)


def test_a_periodic_excitation_takes_whole_periods():
    u, y, r, plant = records_of("lag", "periodic", 10.0, 2000, 1, np.random.default_rng(4))
    found = driven_response(u[:, 0], y[:, 0], r[:, 0], 0.5)
    assert np.allclose((found.frequency_hz * 0.5 * 256) % 1, 0)
    apart = found.response[:, 0, 0] / plant(np.exp(0.5j * found.omega)).ravel() - 1
    assert np.median(np.abs(apart)) < 0.5


def test_lines_that_the_excitation_does_not_reach_are_left_out():
    rng = np.random.default_rng(5)
    u, y, r, _ = records_of("lag", "steps", 3.0, 2000, 1, rng)
    found = driven_response(u[:, 0], y[:, 0], r[:, 0], 1.0)
    assert found.chosen < 0.9
    assert np.isfinite(found.radius(confidence=0.95)).all()


def test_noise_alone_is_seen_at_no_line():
    rng = np.random.default_rng(6)
    rows = [seen(np.sum(rng.standard_normal((200, 2)) ** 2, axis=1) / 2, 40) for _ in range(300)]
    assert np.mean([row.any() for row in rows]) < 0.02
    assert of_chosen(0.95, np.array(0.5)) == pytest.approx(0.975)


def test_several_outputs_each_have_their_region():
    u, y, r, _ = records_of("lag", "binary", 10.0, 2000, 1, np.random.default_rng(7))
    found = driven_response(u[:, 0], np.column_stack([y, 2 * y]), r[:, 0], 1.0)
    np.testing.assert_allclose(found.response[:, 1], 2 * found.response[:, 0])
    np.testing.assert_allclose(
        found.radius(confidence=0.9)[:, 1], 2 * found.radius(confidence=0.9)[:, 0]
    )


@pytest.fixture(scope="module")
def record():
    """Input, output and excitation (400,) of a loop."""
    rng = np.random.default_rng(8)
    return tuple(one[:, 0] for one in records_of("lag", "binary", 3.0, 400, 1, rng)[:3])


def spoilt(values, at, wrong):
    """The values with another one at a place."""
    return np.where(np.arange(len(values)) == at, wrong, values)


BAD = {
    "another length": (lambda u, y, r: (u, y, r[:-1]), {}, "excitation"),
    "the input itself": (lambda u, y, r: (u, y, u), {}, "input itself"),
    "the input in other units": (lambda u, y, r: (u, y, 3 - 2 * u), {}, "input itself"),
    "constant": (lambda u, y, r: (u, y, 0 * r + 1), {}, "excitation.*never changes"),
    "NaN": (lambda u, y, r: (u, y, spoilt(r, 7, np.nan)), {}, "excitation.*NaN"),
    "infinite": (lambda u, y, r: (u, spoilt(y, 7, np.inf), r), {}, "y has 1 samples"),
    "text": (lambda u, y, r: (u, y, ["a"] * 400), {}, "real numbers"),
    "complex": (lambda u, y, r: (u, y, 1j * r), {}, "real numbers"),
    "two excitations": (lambda u, y, r: (u, y, np.c_[r, r[::-1]]), {}, "one of each"),
    "two inputs": (lambda u, y, r: (np.c_[u, r[::-1]], y, r), {}, "one of each"),
    "four axes": (lambda u, y, r: (u, y, np.ones((400, 1, 1, 1))), {}, "samples by channels"),
    "a number": (lambda u, y, r: (u, y, 1.0), {}, "samples by channels"),
    "a period of a sample": (lambda u, y, r: (u, y, 1), {}, "period of 2 to 200 samples"),
    "a period as long": (lambda u, y, r: (u, y, 201), {}, "period of 2 to 200 samples"),
    "another period": (lambda u, y, r: (u, y, 97), {}, "seen in the input|in common"),
    "unlike rows": (lambda u, y, r: (u, y, [[1.0], [2.0, 3.0]]), {}, "samples by channels"),
    "true": (lambda u, y, r: (u, y, True), {}, "samples by channels"),
    "nothing": (lambda u, y, r: (u, y, []), {}, "no samples"),
    "short": (lambda u, y, r: (u[:40], y[:40], r[:40]), {}, "40 samples"),
    "no sampling time": (lambda *record: record, {"dt": 0}, "dt"),
    "one frequency": (lambda *record: record, {"most": 1}, "most"),
    "a part of a frequency": (lambda *record: record, {"most": 2.5}, "most"),
    "no assumption": (lambda *record: record, {"assume": 3}, "assume"),
    "noise beside": (
        lambda u, y, r: (u, y, np.random.default_rng(9).standard_normal(400)),
        {},
        "seen in the input",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_no_excitation_is_named(case, record):
    spoil, options, words = BAD[case]
    with pytest.raises(InputError, match=words):
        driven_response(*spoil(*record), **{"dt": 1.0} | options)
