"""Every road from a record tests it first, refuses what forbids, and carries what was tested."""

import numpy as np
import pytest
from scipy.signal import lfilter
from simulated_loops import records_of

import workbench as wb
from workbench.errors import InputError, UnknownNameError
from workbench.identification import (
    ClosedLoopFit,
    FittedParameter,
    MeasuredRecord,
    MeasuredResponse,
    ParameterFit,
    SampledRecord,
    StateSpaceFit,
    arx,
    as_experiments,
    driven_response,
    fit_rational_model,
    impulse_response,
    local_polynomial,
    local_rational,
    local_response,
    record_report,
    spectral_response,
)
from workbench.identification.record_tests import report as frame
from workbench.identification.record_tests.finding import Finding
from workbench.identification.record_tests.finding import TestedAssumption as ToldAssumption
from workbench.synthesis import HinfSynthesis, MuSynthesis
from workbench.uncertainty import Responses, StadiumCover, generalised_plant


def forbids_undriven(record):
    """A test that finds feedback in every record without an excitation."""
    found = Finding(
        "feedback", "'u1' follows 'y1'", "input 'u1'", 0.5, "share of u's variance from y",
        "give excitation=", forbids=record.r is None,
    )  # fmt: skip
    return ToldAssumption("open loop", "half of u can come from y", findings=(found,))


@pytest.fixture
def closed(monkeypatch):
    """Every record without an excitation counts as one of a closed loop."""
    monkeypatch.setattr(frame, "TESTS", (forbids_undriven,))


@pytest.fixture(scope="module")
def record():
    """Input, output and excitation (N,) of a loop."""
    rng = np.random.default_rng(1)
    return tuple(one[:, 0] for one in records_of("lag", "binary", 10.0, 600, 1, rng)[:3])


def simulated(u, y, assume=()):
    """A simulated model, beside its record."""
    return MeasuredRecord(
        lambda p, x, u: ([p["a"] * x[0] + u[0]], [x[0]]), lambda p: [0.0], u, y, assume=assume
    )


ROADS = {
    "local polynomials": lambda u, y, **a: local_polynomial(u[:, None], y[:, None], **a),
    "local models": lambda u, y, **a: local_response(u[:, None], y[:, None], 1.0, **a),
    "local rational functions": lambda u, y, **a: local_rational(u[:, None], y[:, None], **a),
    "averaged spectra": lambda u, y, **a: spectral_response(u, y, 1 / 1.0, 60, **a),
    "a state-space fit": lambda u, y, **a: StateSpaceFit(u, y, orders=[1], **a),
    "ARX": lambda u, y, **a: arx(as_experiments(u, y, **a), 2),
    "impulse responses": lambda u, y, **a: impulse_response(as_experiments(u, y, **a)),
    "a transfer function": lambda u, y, **a: SampledRecord(u, y, 1 / 1.0, **a),
    "a simulation": simulated,
}


@pytest.mark.parametrize("road", ROADS)
def test_what_forbids_ends_every_road(road, record, closed):
    with pytest.raises(InputError, match=r"follows 'y1'.*excitation=.*assume=\['open loop'\]"):
        ROADS[road](*record[:2])


@pytest.mark.parametrize("road", ROADS)
def test_who_knows_better_says_so(road, record, closed):
    ROADS[road](*record[:2], assume=["open loop"])
    with pytest.raises(UnknownNameError, match="open lop"):
        ROADS[road](*record[:2], assume=["open lop"])


def test_an_excitation_opens_the_road(record, closed):
    u, y, r = record
    assert driven_response(u, y, r, 1.0).report.usable
    assert ClosedLoopFit(u, y, orders=[1], excitation=r).report.usable
    SampledRecord(u, y, 1 / 1.0, noise_free_input=r)


def test_a_fit_without_excitation_is_told_to_open_the_loop(record):
    with pytest.raises(InputError, match="open the loop, or add an excitation") as error:
        ClosedLoopFit(*record[:2])
    assert "StateSpaceFit" not in str(error.value)


def told(certificate):
    """Whether a certificate says that the loop was taken as open, against the finding."""
    words = "open loop: assumed by the user, against the finding: 'u1' follows 'y1'"
    return any(words in fact for fact in certificate.facts)


def test_certificates_of_models_say_what_was_tested(closed):
    u = np.random.default_rng(2).standard_normal(300)
    y = lfilter([0, 0.5], [1, -0.5], u) + 1e-3 * np.random.default_rng(3).standard_normal(300)
    fit = StateSpaceFit(u, y, orders=[1], assume="open loop")
    assert told(wb.solve(fit, method="n4sid").certificate)
    model = simulated(0.5 * u, y, assume="open loop")
    fit = ParameterFit([model], {"a": FittedParameter(0.4)})
    assert told(wb.solve(fit, method="scipy").certificate)


def test_certificates_of_fits_to_responses_say_what_was_tested(closed):
    u = np.random.default_rng(2).standard_normal(2000)
    y = lfilter([0, 0.5], [1, -0.5], u) + 0.1 * np.random.default_rng(3).standard_normal(2000)
    found = spectral_response(u, y, 1 / 1.0, 100, assume="open loop")
    assert told(fit_rational_model(found, orders=[1], dt=1.0).certificate)
    assert MeasuredResponse.of(lambda p, s: p["k"], found).report is found.report


@pytest.fixture
def covered(closed):
    """A cover of two lags, from records that count as closed, and its solution."""
    rng, estimates = np.random.default_rng(4), []
    for gain in (0.5, 0.55):
        u = rng.standard_normal(4000)
        y = lfilter([0, gain], [1, -0.5], u) + 0.01 * rng.standard_normal(4000)
        estimates.append(spectral_response(u, y, 1 / 20.0, 100, assume="open loop"))
    responses = Responses.from_estimates(estimates, plants=["one", "two"]).within(0.2, 2.0)
    return wb.solve(StadiumCover(responses, 2, zeros=1, confidence=0.9))


@pytest.mark.cases(0)
def test_a_controller_of_a_cover_says_what_was_tested(covered):
    import control

    assert told(covered.certificate)
    again = covered.task.from_dataset(covered.task.to_dataset(covered.answer))
    for model in (covered.answer.model, again.model):
        plant = generalised_plant(
            [(model, "u", "y"), (control.tf([0.1, 1], [1, 0.1]), "e", "z_e"), (0.01, "u", "z_u")],
            {"e": "r - y"},
            exogenous="r", control="u", performance=["z_e", "z_u"], measurement="e",
        )  # fmt: skip
        assert any("assumed by the user" in fact for fact in plant.tested)
        assert MuSynthesis(plant).plant.tested == plant.tested
        assert HinfSynthesis(plant.unstructured()).plant.tested == plant.tested


def test_records_that_differ_are_told_apart():
    one, other = (
        frame.RecordReport((ToldAssumption("open loop", result), ToldAssumption("no gaps", "none")))
        for result in ("tested well", "tested badly")
    )
    assert frame.together({"a": one, "b": other}) == (
        "no gaps: tested; none",
        "a: open loop: tested; tested well",
        "b: open loop: tested; tested badly",
    )


def test_the_report_of_experiments_is_made_once(record, closed):
    experiments = as_experiments(*record[:2])
    assert experiments.report is experiments.report
    assert not experiments.report.usable
    assert as_experiments(*record[:2], assume="open loop").report.usable


def test_a_report_is_short_and_says_what_forbids(record, closed):
    report = record_report(*record[:2])
    assert repr(report).splitlines()[1].startswith("  forbids  feedback")
    assert record_report(*record[:2], r=record[2]).usable
    assert report.sentences == ("open loop: tested; half of u can come from y",)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"direct": 1}, "direct"),
        ({"dt": -1.0}, "dt"),
        ({"r": np.ones(600)}, "never changes"),
        ({"r": np.ones(10)}, "excitation"),
        ({"r": "set-point"}, "excitation"),
        ({"r": np.where(np.arange(600) == 5, np.nan, np.arange(600.0))}, "excitation"),
    ],
)
def test_bad_requests_of_a_report_are_named(given, words, record):
    with pytest.raises(InputError, match=words):
        record_report(*record[:2], **given)


def test_responses_show_what_was_found_in_their_records():
    u = np.random.default_rng(2).standard_normal(600)
    y = np.convolve(u, [0.5, 0.3])[:600]
    y[[100, 300]] += 40.0
    told = Responses(
        omega=[1.0, 2.0], values=[[1.0, 2.0], [1.0, 2.0]], plants=["a", "b"],
        reports={"a": record_report(u, y)},
    )  # fmt: skip
    assert "found: spikes (a), see reports" in repr(told)
