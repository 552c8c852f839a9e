"""One plant, or a few, and a spread that is stated about them."""

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.path import Path as Polygon

from workbench.cli import main
from workbench.errors import InputError
from workbench.identification import ResponseEstimate
from workbench.solution import solve
from workbench.uncertainty import CircleCover, Responses, contains

FREQUENCY = np.geomspace(0.1, 10.0, 120)


def resonance(frequency, at=2.0, damping=0.2):
    return 1.0 / (1 - (frequency / at) ** 2 + 2j * damping * frequency / at)


def estimate(response, deviation=1e-3):
    variance = np.full((response.size, 1, 1), deviation**2)
    return ResponseEstimate(FREQUENCY, response[:, None, None], variance, 40.0)


RIG = estimate(resonance(FREQUENCY))


def test_every_plant_within_the_spread_lies_between_the_stated_ones():
    found = Responses.from_estimates(RIG, spread=0.2, plants=["rig"])
    assert found.plants[0] == "rig [1]" and len(set(found.plants)) == 12
    assert "stated, not measured" in found.assumption and "20 %" in found.assumption
    turn = 0.2 * np.exp(2j * np.pi * np.random.default_rng(0).uniform(size=50))
    for values, own in zip(found.values, RIG.response[:, 0, 0], strict=True):
        corners = Polygon(np.c_[values.real, values.imag])
        other = own * (1 + turn)
        assert corners.contains_points(np.c_[other.real, other.imag]).all()
        assert np.abs(values / own - 1).max() < 0.2 * 1.04
    size = np.abs(found.values / RIG.response[:, 0])
    np.testing.assert_allclose(found.variance, 1e-6 * size**2)


@pytest.mark.parametrize("shift", [-0.1, -0.05, 0.0, 0.05, 0.1])
def test_shifted_resonances_are_among_the_stated_ones(shift):
    found = Responses.from_estimates([RIG], resonance_shift=0.1)
    assert found.values.shape[1] == 5
    assert FREQUENCY[0] < found.frequency_hz[0] and found.frequency_hz[-1] < FREQUENCY[-1]
    moved = resonance(found.frequency_hz, at=2.0 * (1 + shift))
    apart = np.abs(found.values - moved[:, None]).max(axis=0).min()
    assert apart < 0.01 * np.abs(moved).max()  # straight lines between the frequencies


def test_both_are_stated_about_each_of_several_plants():
    other = estimate(1.5 * resonance(FREQUENCY))
    found = Responses.from_estimates([RIG, other], spread=0.1, resonance_shift=0.02)
    assert found.values.shape[1] == 2 * 5 * 12 == len(set(found.plants))
    gains = np.abs(found.values[0])
    first = np.array(["plant 1" in name for name in found.plants])
    assert gains[first].max() < 1.2 < 1.3 < gains[~first].min()


def test_a_cover_about_one_plant_holds_what_the_spread_allows_and_not_more():
    found = Responses.from_estimates(RIG, spread=0.2)
    answer = solve(CircleCover(found, 2, complex_order=2, confidence=0.95), method="steps").answer
    inside, outside = (
        Responses(omega=found.omega, values=np.outer(resonance(FREQUENCY), gains))
        for gains in ([0.81, 1.19], [0.5, 1.5])
    )
    assert contains(answer.model, inside).holds and not contains(answer.model, outside).holds


@pytest.fixture
def record(tmp_path):
    rng = np.random.default_rng(1)
    u = rng.normal(size=400)
    y = np.convolve(u, 0.5 ** np.arange(20))[:400] + 0.01 * rng.normal(size=400)
    rows = np.c_[0.1 * np.arange(400), u, y]
    np.savetxt(tmp_path / "rig.csv", rows, delimiter=",", header="t,u,y", comments="")
    return tmp_path / "rig.csv"


def test_one_file_needs_a_stated_spread(record):
    names = {"input": "u", "output": "y", "time": "t"}
    with pytest.raises(InputError, match=r"only file.*spread=0.2.*--spread 20%"):
        Responses.from_files(record, **names)
    found = Responses.from_files(record, spread=0.2, hold=True, **names)
    assert found.plants[-1] == "rig [12]" and found.read.endswith("is taken out")


@pytest.mark.parametrize("wrong", [{"spread": 0.0}, {"spread": 20}, {"resonance_shift": "5%"}])
def test_what_is_no_share_is_refused(wrong):
    with pytest.raises(InputError, match=r"between 0 and 1: 0.2 for 20 %"):
        Responses.from_estimates(RIG, **wrong)


def test_a_shift_that_leaves_no_frequencies_is_refused():
    few = ResponseEstimate(np.array([1.0, 1.1]), np.ones((2, 1, 1)), np.ones((2, 1, 1)), 9.0)
    with pytest.raises(InputError, match="leaves 0 of the frequencies"):
        Responses.from_estimates(few, resonance_shift=0.3)


def test_a_spread_belongs_to_records(tmp_path):
    (tmp_path / "d.csv").write_text("f,re,im\n1,1,0\n2,2,1\n")
    with pytest.raises(InputError, match="plants of records"):
        Responses.from_files(tmp_path / "d.csv", frequency="f", response=("re", "im"), spread=0.2)


def test_the_command_names_a_share_that_is_none(record):
    words = ["init", "rig", "--data", str(record), "--spread", "some"]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 2 and "write 20% or 0.2" in result.output
