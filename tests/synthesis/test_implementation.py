"""Controllers as a processor runs them: bounds of the sampled loop, and C code run in it."""

from dataclasses import replace

import control
import numpy as np
import pytest
from compiled_code import Compiled, needs_compiler

from workbench.errors import InputError
from workbench.solution import solve
from workbench.solvers import Outcome
from workbench.synthesis import Implementation, WorkingPoint, discretise
from workbench.synthesis.implementation.c_code.c_state_space import anti_windup_gain, start_gains
from workbench.synthesis.implementation.rounding import absolute_sums
from workbench.uncertainty import UncertaintyModel, generalised_plant

PERIOD, DELAY = 1e-3, 1.0
s = control.tf("s")
G = control.tf([100.0], [1.0, 3.0, 100.0], inputs="u", outputs="y")
PI = control.tf([0.2, 2.0], [1.0, 0.01], inputs="y", outputs="u") * 40 / (s + 40)
MODEL = UncertaintyModel(
    G, 0.05 * (s + 5) / (s / 20 + 5), 0.1 * (s + 10) / (s + 30), form="multiplicative"
)


@pytest.fixture(scope="module", params=["double", "float", "fixed"])
def done(request):
    """A task and its solution in each number format."""
    more = {"full_scale": (2.0, 4.0)} if request.param == "fixed" else {}
    task = Implementation(MODEL, PI, PERIOD, delay_samples=DELAY, precision=request.param, **more)
    return task, solve(task)


def in_the_loop(task, step, w):
    """Controls (N,) of a controller in the loop with disturbances w (N,) of the measurement."""
    held = task.loop.loop_of(task.implemented("tustin").K).held()
    x, u, found = np.zeros(held.nstates), np.zeros(1), []
    for error in w:
        y = held.C @ x + held.D @ u + error
        own = step(y)
        found.append(float(own[0]))
        u = -own
        x = held.A @ x + held.B @ u
    return np.array(found)


def model_step(K):
    state = np.zeros(K.nstates)

    def step(y):
        nonlocal state
        u = K.C @ state + K.D @ y
        state = K.A @ state + K.B @ y
        return u

    return step


@pytest.mark.cases(0)
def test_the_certificate_holds_and_comes_back(done):
    task, found = done
    assert found.outcome is Outcome.SOLVED, found.message
    names = [check.name for check in found.certificate.checks]
    for name in ("sampled loop", "sets of plants", "no limit cycle", "plants of the set"):
        assert name in names
    back = task.from_dataset(task.to_dataset(found.answer))
    assert task.certify(back, 1e-6, optimal=False).holds
    assert task.metrics(back) == task.metrics(found.answer)
    assert back.code() == found.answer.code()
    assert set(task.figures(back)) == {"loop", "controller"}
    assert task.tables(back)["code"].startswith("```c\n/* Controller")


@pytest.mark.cases(1)
@needs_compiler
def test_the_compiled_code_runs_in_the_loop_as_the_model_does(done, tmp_path):
    task, found = done
    answer = found.answer
    w = np.random.default_rng(0).choice([-1.0, 1.0], size=600)
    expected = in_the_loop(task, model_step(answer.K), w)
    board = Compiled(answer, tmp_path)
    limit = answer.rounding.share * (task.full_scale[1] if task.full_scale else 1.0)
    if task.precision != "fixed":
        # The claim is over the largest control that any disturbance of 1 brings about.
        closed = task.loop.closed(answer.K)
        limit *= absolute_sums(closed.A, closed.B, closed.C, closed.D)[1, 0]
    off = np.abs(in_the_loop(task, board.step, w) - expected).max()
    assert off <= limit
    assert task.precision == "double" or off > 0.0


@pytest.mark.slow
def test_the_best_way_is_not_worse_than_the_others():
    task = Implementation(MODEL, PI, 0.02, delay_samples=DELAY)
    found = {name: solve(task, method=name) for name in ("tustin", "zoh", "foh", "best")}
    peaks = {name: task.objective(one.answer) for name, one in found.items()}
    assert peaks["best"] == min(peaks.values())
    assert len({round(peak, 6) for peak in peaks.values()}) == 3


@pytest.mark.cases(1)
def test_a_mutated_controller_or_claim_is_refused(done):
    task, found = done
    answer = found.answer
    assert not task.certify(
        replace(answer, sensitivity=answer.sensitivity / 1.01), 1e-6, optimal=False
    ).valid
    less = replace(answer.peak, upper=answer.peak.upper / 1.01)
    assert not task.certify(replace(answer, peak=less), 1e-6, optimal=False).valid
    smaller = replace(answer.rounding, share=answer.rounding.share / 1.01)
    assert not task.certify(replace(answer, rounding=smaller), 1e-6, optimal=False).valid
    K = answer.K
    louder = replace(answer, K=control.ss(K.A, K.B, 40 * K.C, 40 * K.D, K.dt))
    assert not task.certify(louder, 1e-6, optimal=False).valid
    if task.precision == "float":
        between = replace(answer, K=control.ss(K.A * (1 + 1e-9), K.B, K.C, K.D, K.dt))
        assert "coefficients" in " ".join(task.certify(between, 1e-6, optimal=False).failures)


@pytest.mark.cases(0)
def test_a_generalised_plant_has_the_signs_and_several_channels():
    two = control.append(G, 2 * G)
    plant = generalised_plant(
        [(two, ["u1", "u2"], ["y1", "y2"])],
        {"e1": "-y1", "e2": "-y2"},
        control=["u1", "u2"],
        measurement=["e1", "e2"],
    )
    K = control.append(PI, 0.3 * PI)
    task = Implementation(plant, K, PERIOD, delay_samples=0.5, precision="float")
    found = solve(task)
    assert found.outcome is Outcome.SOLVED and found.answer.peak is None
    assert len(found.answer.margins) == 2
    assert task.metrics(found.answer)["peak"] == found.answer.sensitivity


@pytest.mark.cases(0)
def test_order_filter_and_limits_are_heeded(tmp_path):
    filtered = 1 / (s / 2000 + 1)
    task = Implementation(
        MODEL,
        PI,
        PERIOD,
        delay_samples=DELAY,
        order=1,
        anti_aliasing=filtered,
        limits=([-1.0], [1.0]),
    )
    answer = solve(task).answer
    assert answer.K.nstates == 1
    assert "anti-windup" in answer.code()
    plain = solve(Implementation(MODEL, PI, PERIOD, delay_samples=DELAY, order=1)).answer
    assert answer.margins[0].phase_deg < plain.margins[0].phase_deg


@pytest.mark.cases(1)
@needs_compiler
@pytest.mark.parametrize("precision", ["double", "float", "fixed"])
def test_anti_windup_shortens_what_a_limit_costs(precision, tmp_path):
    """A step that saturates: with anti-windup the error is over sooner, with less overshoot."""
    K = control.tf([0.5, 20.0], [1.0, 0.0], inputs="e", outputs="u")
    plant = control.tf([1.0], [1.0, 1.0])
    fixed = precision == "fixed"
    ends = {"full_scale": (2.0, 1.5)} if fixed else {"limits": ([-1.5], [1.5])}
    answer = solve(Implementation(plant, K, 0.01, precision=precision, **ends)).answer
    board = Compiled(answer, tmp_path)
    state, clipped = np.zeros(answer.K.nstates), []
    held = control.sample_system(control.ss(plant), 0.01)

    def plain(y):
        nonlocal state
        u = answer.K.C @ state + answer.K.D @ y
        state = answer.K.A @ state + answer.K.B @ y
        return np.clip(u, -1.5, 1.5)

    for step in (board.step, plain):
        x, y = np.zeros(held.nstates), []
        for _ in range(800):
            y.append((held.C @ x).item())
            x = held.A @ x + held.B @ step(np.array([1.0 - y[-1]]))
        clipped.append(np.array(y))
    with_it, without = clipped
    assert with_it.max() < 1.0 + 0.7 * (without.max() - 1.0)
    assert np.abs(with_it - 1).sum() < 0.8 * np.abs(without - 1).sum()


@pytest.mark.cases(1)
@needs_compiler
def test_it_takes_over_without_a_bump(done, tmp_path):
    answer = done[1].answer
    board = Compiled(answer, tmp_path)
    accuracy = {"double": 1e-9, "float": 1e-5, "fixed": 1e-6}[answer.precision]
    for y, u in ((0.3, -2.0), (0.0, 3.0)):
        board.take([y], [u])
        assert board.step([y])[0] == pytest.approx(u, rel=accuracy)


def test_the_start_holds_what_an_integrator_holds():
    K = discretise(control.tf([1.0, 3.0], [1.0, 0.0]), 0.1)
    from_y, from_u = start_gains(K)
    x = from_u[:, 0] * 4.0
    np.testing.assert_allclose(K.A @ x, x)
    assert (K.C @ x).item() == pytest.approx(4.0)
    assert from_y.shape == from_u.shape == (1, 1)


@pytest.mark.parametrize("seed", range(8))
def test_the_start_has_no_gain_that_is_rounding_only(seed):
    """Two loops that share nothing: a signal of one moves no state of the other, to the last
    bit."""
    rng = np.random.default_rng(seed)

    def one(size):
        poles = [1.0, *rng.uniform(-0.5, 0.95, 3)]
        turn = np.linalg.qr(rng.normal(size=(4, 4)))[0]
        B, C = rng.normal(size=(4, 1)), size * rng.normal(size=(1, 4))
        return control.ss(turn @ np.diag(poles) @ turn.T, turn @ B, C @ turn.T, [[size]], 0.1)

    K = control.append(one(1.0), one(30.0))
    from_y, from_u = start_gains(K)
    for gains in (from_y, from_u):
        assert (gains[:4, 1] == 0.0).all() and (gains[4:, 0] == 0.0).all()
        assert (gains[:4, 0] != 0.0).all() and (gains[4:, 1] != 0.0).all()
    y, u = rng.normal(size=2), rng.normal(size=2)
    x = from_y @ y + from_u @ u
    assert K.C @ x + K.D @ y == pytest.approx(u, rel=1e-11)  # no bump


@pytest.mark.parametrize("seed", range(5))
def test_conditioning_is_stable_and_inverts_where_it_can(seed):
    rng = np.random.default_rng(seed)
    K = control.drss(4, 2, 2)
    K = control.ss(K.A, K.B, K.C, rng.normal(size=(2, 2)), 1.0)
    H = anti_windup_gain(K)
    assert np.abs(np.linalg.eigvals(K.A - H @ K.C)).max() < 1.0
    inverse = K.A - K.B @ np.linalg.solve(K.D, K.C)
    if np.abs(np.linalg.eigvals(inverse)).max() < 0.95:
        np.testing.assert_allclose(H, K.B @ np.linalg.inv(K.D), atol=1e-3 * np.abs(H).max())


@pytest.mark.parametrize("seed", range(6))
def test_absolute_sums_bound_and_are_near(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 7))
    A = rng.normal(size=(n, n))
    A *= rng.choice([0.5, 0.9, 0.999]) / np.abs(np.linalg.eigvals(A)).max()
    B, C, D = rng.normal(size=(n, 2)), rng.normal(size=(3, n)), rng.normal(size=(3, 2))
    total, x = np.abs(D), B
    for _ in range(20_000):
        total = total + np.abs(C @ x)
        x = A @ x
    bound = absolute_sums(A, B, C, D)
    assert (bound >= total * (1 - 1e-12)).all()
    assert (bound <= 1.02 * total).all()
    assert np.isinf(absolute_sums(np.eye(1), B[:1], C[:, :1], D)).all()


@pytest.mark.cases(0)
@pytest.mark.filterwarnings("ignore:the sampling time:workbench.errors.RangeWarning")
def test_rounding_of_a_stiff_float_loop_is_refused_not_ignored():
    """Poles a millionth from the circle: single precision loses the slow one, and says so."""
    slow = control.tf([1e-3, 1e-6], [1.0, 1e-7])
    plant = control.tf([1.0], [1.0, 1.0])
    single = solve(Implementation(plant, slow, 1e-5, precision="float"))
    double = solve(Implementation(plant, slow, 1e-5, precision="double"))
    assert double.certificate.valid
    assert double.answer.rounding.share < 1e-4
    assert not single.certificate.valid
    assert single.certificate.failures[0].startswith("no limit cycle")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"controller": "K"}, "controller must be a StateSpace.*not str"),
        ({"controller": control.append(PI, PI)}, "has 2 inputs and 2 outputs; the plant has 1"),
        ({"controller": discretise(PI, 2e-3)}, "has dt = 0.002; give a continuous controller"),
        ({"plant": None}, "plant must be a StateSpace.*NoneType"),
        ({"plant": discretise(PI, 2e-3)}, "the plant is sampled"),
        ({"dt": 0.0}, "dt is 0.0; it must be a number, positive"),
        ({"dt": "1 ms"}, "dt is '1 ms'"),
        ({"delay_samples": -1.0}, "delay_samples is -1"),
        ({"precision": "half"}, "precision is 'half'; it must be one of"),
        ({"precision": "fixed"}, "fixed point needs full_scale="),
        ({"full_scale": (1.0, 1.0)}, "full_scale belongs to fixed point"),
        ({"precision": "fixed", "full_scale": (1.0, -1.0)}, "full scale of controls is -1"),
        ({"limits": (1.0, 0.0)}, "each lowest below its highest"),
        ({"limits": (0.0, 1.0), "working_point": WorkingPoint(2.0, 0.0)}, "2 is not between"),
        ({"limits": (-1.0, 1.0), "working_point": WorkingPoint(1.0, 0.0)}, "limits are absolute"),
        ({"working_point": 50.0}, "working_point is 50.0; a WorkingPoint"),
        ({"working_point": WorkingPoint((1.0, 2.0), 0.0)}, "2 controls and 1 measurements"),
        ({"rate_limit": -1.0}, "rate_limit is -1.0; it must be the largest change in a second"),
        ({"rate_limit": (1.0, 2.0)}, "positive and finite, of 1 controls"),
        ({"order": 9}, "order is 9; controller has 2 states"),
        ({"order": 1.5}, "order is 1.5; it must be a whole number"),
        ({"anti_aliasing": control.append(G, G)}, "anti_aliasing has 2 inputs"),
        ({"anti_aliasing": s}, "anti_aliasing has no realisation"),
        ({"sign": 2}, "sign is 2"),
    ],
)  # fmt: skip
def test_bad_input(change, words):
    whole = {"controller": PI, "plant": MODEL, "dt": PERIOD, "delay_samples": DELAY} | change
    with pytest.raises(InputError, match=words):
        solve(Implementation(**whole))


def test_a_wrong_sign_is_named():
    """K = 2 stabilises 1 / (s - 1) as u = -K y; turned round it does not, whatever the sampling."""
    plant, K = control.ss(control.tf(1, [1, -1])), control.ss([], [], [], [[-2.0]])
    found = solve(Implementation(plant, K, 0.01))
    assert found.outcome is Outcome.FAILED
    assert "with the other sign, u = K y, it is stable: give sign=1" in found.message
    assert solve(Implementation(plant, K, 0.01, sign=1)).certificate.valid


def test_an_unstable_loop_says_which_pole():
    found = solve(Implementation(MODEL, 60 * PI, PERIOD, delay_samples=DELAY))
    assert found.outcome is Outcome.FAILED
    assert "the sampled loop is unstable, its largest pole" in found.message


def test_the_code_has_to_be_a_header(done, tmp_path):
    with pytest.raises(InputError, match=r"exported as a C header, .h"):
        done[1].answer.export(tmp_path / "board.json")
