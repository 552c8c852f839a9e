"""The first bandwidth is lowered until its weights are kept, or the failure is told."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from workbench.cli import main
from workbench.errors import InputError
from workbench.starter import FirstChoices, kept_weights

DESIGN = """
from types import SimpleNamespace
from workbench.errors import InputError
NEEDED = {"additive circle": 6, "multiplicative stadium": 10}
def cover(shape, form, weight_order):
    name = f"{form} {shape}"
    if weight_order > 6:
        raise InputError("too few frequencies")
    rms = 1.0 if weight_order >= NEEDED.get(name, 4) else 2.0
    return SimpleNamespace(name=name, inflation=lambda answer: SimpleNamespace(rms=rms))
def weighted(model, bandwidth, effort): return bandwidth, model
"""


def choices(bandwidth=8.0, **given):
    return FirstChoices((0.1, 100.0), 2, 0, bandwidth, 0.05, {"bandwidth_hz": "first"}, **given)


@pytest.fixture
def settled(tmp_path, monkeypatch):
    """The choices, and the bandwidths and shapes tried, of which the peak is a function."""
    file = tmp_path / "design.py"
    file.write_text(DESIGN)

    def settle(peak, least=0.0, **given):
        tried = []

        def solve(task):  # without a time limit: a busy computer tries as much as another
            if hasattr(task, "inflation"):
                valid = SimpleNamespace(valid=True)
                return SimpleNamespace(certificate=valid, answer=SimpleNamespace(model=task.name))
            tried.append(task)
            return SimpleNamespace(answer=SimpleNamespace(upper=peak(*task)))

        def lower(most):
            if most < least:
                raise InputError("an unstable pole needs more")
            return replace(choices(), bandwidth_hz=most)

        monkeypatch.setattr(kept_weights, "solve", solve)
        monkeypatch.setattr(kept_weights, "MuSynthesis", lambda plant, **_: plant)
        monkeypatch.setattr(kept_weights, "fewest_states", lambda best, plant, found: best)
        return kept_weights.kept_weights(file, choices(), given.get("lower", lower)), tried

    return settle


COVERS = ["multiplicative circle", "additive circle", "multiplicative stadium"]


def on_each(*bandwidths):
    return [(bandwidth, cover) for bandwidth in bandwidths for cover in COVERS]


def test_a_bandwidth_that_is_kept_stays(settled):
    found, tried = settled(lambda bandwidth, cover: 0.9)
    assert (found.bandwidth_hz, found.peak, tried) == (8.0, 0.9, on_each(8.0))
    assert found.reasons["bandwidth_hz"] == "first"


@pytest.mark.parametrize("better", COVERS)
def test_the_cover_of_the_smallest_peak_is_taken(settled, better):
    found, _ = settled(lambda bandwidth, cover: 0.8 if cover == better else 0.9)
    assert (f"{found.form} {found.shape}", found.peak) == (better, 0.8)
    assert f"{better}s 0.8" in found.reasons["shape"]


@pytest.mark.parametrize(("better", "order"), list(zip(COVERS, (4, 6, 6), strict=True)))
def test_a_weight_far_larger_than_the_sets_gets_a_higher_order(settled, better, order):
    found, _ = settled(lambda bandwidth, cover: 0.8 if cover == better else 0.9)
    assert found.weight_order == order  # the last cover would need 10, its frequencies allow 6


def test_it_is_lowered_until_the_weights_are_kept_and_then_refined(settled):
    found, tried = settled(lambda bandwidth, cover: bandwidth / (4 if cover == COVERS[1] else 3))
    finer = [3.125 * 1.6**share for share in (1 / 2, 1 / 4, 3 / 8)]
    assert tried[:9] == on_each(8.0, 5.0, 3.125)
    assert [one[0] for one in tried[9:]] == pytest.approx(finer)
    assert {one[1] for one in tried[9:]} == {COVERS[1]}
    assert found.bandwidth_hz == pytest.approx(finer[2])
    assert found.peak == pytest.approx(finer[2] / 4)
    assert "at 8 Hz it is 2" in found.reasons["bandwidth_hz"]


def test_a_bandwidth_that_is_asked_for_is_the_only_one(settled):
    found, tried = settled(lambda bandwidth, cover: 2.0, lower=None)
    assert (found.bandwidth_hz, tried) == (8.0, on_each(8.0))


def test_where_none_is_kept_the_least_peak_is_told(settled):
    found, tried = settled(lambda bandwidth, cover: 1.2 + abs(bandwidth - 5.0), least=3.0)
    assert tried == on_each(8.0, 5.0, 3.125)
    assert (found.bandwidth_hz, found.peak) == (5.0, 1.2)


def test_init_says_in_red_that_no_weights_are_kept(tmp_path, monkeypatch):
    monkeypatch.setattr("workbench.starter.write_study", lambda *_, **__: choices(peak=1.3))
    asked = ["init", str(tmp_path / "servo"), "--data", "drive*.csv"]
    said = CliRunner().invoke(main, asked, color=True)
    assert said.exit_code == 1
    assert "\x1b[31m! no controller was found that keeps its weights" in said.output
    assert "at 8 Hz the certified peak of mu is 1.3" in said.output


@pytest.mark.parametrize("edge", [0.3, 0.5, 0.99])
def test_the_gap_between_a_kept_and_a_too_fast_bandwidth_is_halved(edge):
    def tried(hz):
        return SimpleNamespace(bandwidth_hz=hz, peak=0.9 if hz < edge else 1.2)

    best, every = kept_weights.halved_gap(tried(0.25), 1.0, tried, 0.98)
    assert len(every) == kept_weights.HALVINGS
    assert best.bandwidth_hz < edge <= best.bandwidth_hz * 4 ** (0.5**kept_weights.HALVINGS) * 1.001
    first = tried(1.0)
    said = kept_weights.bandwidth_reason([first, *every], best, first)
    assert said.endswith("below 1, 0.9; at 1 Hz it is 1.2")
