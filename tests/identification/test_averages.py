"""Averages of models: the mean of their runs, as one model."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench import solve
from workbench.errors import InputError
from workbench.identification import Experiments, StateSpaceFit
from workbench.identification.choice import methods as choice
from workbench.identification.choice.averages import averaged_predictor, averaged_simulator
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.polynomials.regressions import arx_from_lags

FREQUENCY = np.linspace(0.01, 0.49, 20)


def models(count=3, seed=0, ny=2):
    """Stable models with stable predictors and with operating points of their own."""
    rng = np.random.default_rng(seed)
    found = []
    while len(found) < count:
        n = int(rng.integers(2, 5))
        A = rng.standard_normal((n, n))
        A *= 0.9 / np.abs(np.linalg.eigvals(A)).max()
        shapes = ((n, 1), (ny, n), (ny, 1), (n, ny))
        B, C, D, K = (rng.standard_normal(shape) for shape in shapes)
        offsets = rng.standard_normal(1), rng.standard_normal(ny)
        model = InnovationsModel(A, B, C, D, 0.1 * K, *offsets)
        found += [model] if model.predictor_radius < 0.98 else []
    return found


def record(samples=400, seed=1, ny=2):
    rng = np.random.default_rng(seed)
    return rng.standard_normal((samples, 1)), rng.standard_normal((samples, ny))


def test_its_predictions_are_the_mean_and_so_are_those_of_its_matrices():
    several, (u, y) = models(), record()
    mean = averaged_predictor(several, np.inf)
    expected = np.mean([m.one_step(u, y, 50) for m in several], axis=0)
    np.testing.assert_allclose(mean.one_step(u, y, 50), expected, atol=1e-12)
    joint = replace(mean, members=())
    late = slice(350, None)  # the initial states, estimated each and together, are forgotten
    np.testing.assert_allclose(joint.one_step(u, y, 50)[late], expected[late], atol=1e-4)


def test_its_simulations_and_its_response_are_the_mean():
    several, (u, y) = models(), record()
    mean = averaged_simulator(several, Experiments(u, y))
    expected = np.mean([m.free_run(u, y, 50) for m in several], axis=0)
    np.testing.assert_allclose(mean.free_run(u, y, 50), expected, atol=1e-12)
    joint = replace(mean, members=())
    np.testing.assert_allclose(joint.free_run(u, y, 50)[350:], expected[350:], atol=1e-4)
    np.testing.assert_allclose(
        mean.response(FREQUENCY),
        np.mean([m.response(FREQUENCY) for m in several], axis=0),
        atol=1e-9,
    )
    assert mean.radius < 1 and mean.predictor_radius < 1


def test_members_whose_mean_is_unstable_are_left_out():
    """The mean of predictors can be unstable in free run though each of them is stable."""
    pair = []
    for pole in (0.9, -0.9):
        lags = np.zeros((1, 3, 2))
        lags[0, :, 1] = -np.poly([pole] * 3)[1:]
        pair.append(arx_from_lags(lags, np.zeros((1, 1)), np.zeros(1)))
    wide = averaged_predictor(pair, np.inf)  # z (z^2 + 3 * 0.9^2)
    assert len(wide.members) == 2
    assert wide.radius == pytest.approx(np.sqrt(3) * 0.9)
    assert averaged_predictor(pair) is pair[0]
    assert len(averaged_predictor([pair[0], pair[0], pair[1]]).members) == 2


def test_models_without_a_mean_are_refused():
    first, second = models(2)
    with pytest.raises(InputError, match="at least one"):
        averaged_predictor([])
    with pytest.raises(InputError, match="delays"):
        averaged_predictor([first, replace(second, delay_samples=(2,))])


def noisy(seed, samples=300):
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal(samples), rng.standard_normal(samples)
    y = lfilter([0.0, 1.0, 0.5], [1.0, -1.5, 0.7], u) + lfilter([1.0, 0.5], [1.0, -0.9], e)
    return u[:, None], y[:, None]


@pytest.mark.cases(0)
def test_the_average_is_certified_and_stored():
    program = StateSpaceFit(*noisy(0), orders=(1, 2, 3))
    solution = solve(program, method="averaged")
    assert solution.certificate.holds, solution.certificate.failures
    assert len(solution.answer.predictor.members) > 1
    back = program.from_dataset(program.to_dataset(solution.answer))
    assert program.metrics(back) == program.metrics(solution.answer)
    assert len(back.simulator.members) == len(solution.answer.simulator.members)
    assert program.certify(back, 1e-6, optimal=False).holds
    facts = " ".join(solution.certificate.facts)
    assert "to predict: the average of" in facts and "in validation it fits" in facts
    wrong = replace(solution.answer.simulator, members=solution.answer.simulator.members[:1])
    assert not program.certify(
        replace(solution.answer, simulator=_shifted(wrong)), 1e-6, optimal=False
    ).holds


def _shifted(model):
    """Members far from the record."""
    members = tuple(replace(m, y_offset=m.y_offset + 100) for m in model.members)
    return replace(model, members=members)


def test_an_average_errs_less_than_its_members_do_in_the_mean():
    program = StateSpaceFit(*noisy(3), orders=(1, 2, 3))
    answer = solve(program, method="averaged").answer
    u, y = program.judged_record.u, program.judged_record.y
    for use, model in enumerate((answer.predictor, answer.simulator)):
        own = program.fits(answer.predictor, answer.simulator, u, y)[use]
        theirs = [program.fits(m, m, u, y)[use] for m in model.members]
        assert own > np.mean(theirs)


@pytest.mark.cases(0)
def test_a_member_that_fails_on_the_whole_part_is_left_out(monkeypatch):
    """A candidate that validates well, and is spoilt when it is fitted to the whole part."""
    program = StateSpaceFit(*noisy(4), orders=(1, 2, 3))
    plain = solve(program, method="averaged").answer
    original = choice.sparse_arx_fits

    def spoilt(program, apart=False):
        def fitted(record, lags):
            model = original(program, apart)(lags)(record)
            whole = record is program.estimation_record
            return replace(model, y_offset=model.y_offset + 1e6) if whole else model

        return lambda lags: lambda record: fitted(record, lags)

    monkeypatch.setattr(choice, "sparse_arx_fits", spoilt)
    answer = solve(program, method="averaged").answer
    labels = [answer.candidates.labels[k] for k in answer.candidates.members(0)]
    few = sum(label.startswith("sparse") for label in labels)
    assert 0 < few < len(labels) / 2
    assert len(plain.predictor.members) == len(labels)
    assert len(answer.predictor.members) == len(labels) - few
    assert all(np.abs(member.y_offset).max() < 1e5 for member in answer.predictor.members)
