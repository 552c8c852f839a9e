"""A method is never believed: the certificate sets the outcome."""

import json
import math

import numpy as np
import pytest
import xarray as xr
from hypothesis import example, given
from hypothesis import strategies as st

from workbench.bench.question import plain
from workbench.certificate import Certificate, Check, Checker, Gap, worst_value
from workbench.errors import InputError, RegistryError, UnknownNameError
from workbench.executor import Context
from workbench.program import Program, conic_method, find_method, method, methods
from workbench.solution import solve
from workbench.solvers import Options, Outcome, conic_solvers

NUMBERS = st.floats() | st.integers(-(10**6), 10**6)


@pytest.fixture
def root(toy):
    return toy.Root((1.0, 4.0, 2.0))


# --- certificates -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "limit", "holds"),
    [
        (0.0, 1.0, True),
        (1.0, 1.0, True),
        (math.nextafter(1.0, 2.0), 1.0, False),
        (-math.inf, 0.0, True),
        (math.inf, 0.0, False),
        (math.nan, 1.0, False),
        (0.0, math.nan, False),
        (math.nan, math.nan, False),
    ],
)
def test_a_check_holds_up_to_its_limit_and_never_for_nan(value, limit, holds):
    certificate = Certificate((Check("a", "b", value, limit),))
    assert certificate.valid is certificate.holds is holds
    assert bool(certificate.failures) is not holds


@pytest.mark.parametrize(
    ("value", "required", "holds"),
    [
        (1e-7, True, True),
        (1e-5, True, False),
        (1e-5, False, True),
        (math.nan, True, False),
        (math.inf, True, False),
        (math.nan, False, True),
    ],
)
def test_a_gap_counts_only_where_optimality_is_claimed(value, required, holds):
    good = Check("good", "", 0.0, 1.0)
    certificate = Certificate((good,), gap=Gap("above a bound", value, 1e-6, required))
    assert certificate.valid
    assert certificate.holds is holds
    assert bool(certificate.failures) is not holds


@pytest.mark.parametrize("required", [True, False])
def test_an_answer_beyond_its_bound_is_wrong(required):
    """Then the answer or the bound is; a rounding error below the tolerance is none."""
    good = Check("good", "", 0.0, 1.0)
    beyond = Certificate((good,), gap=Gap("above a bound", -1e-3, 1e-6, required))
    assert not beyond.valid and not beyond.holds and "beyond its bound" in beyond.failures[0]
    assert Certificate((good,), gap=Gap("above a bound", -1e-9, 1e-6, required)).holds


def test_what_is_not_checked_does_not_hold():
    assert not Certificate(()).holds and Certificate(()).failures == ("nothing is checked",)
    refutes = Certificate((Check("a", "b", 0.0, 1.0, opinion=True),))
    assert not refutes.valid
    assert refutes.failures == ("nothing is checked but by a second opinion",)
    assert not Check("none", "", 0.0, math.inf).holds
    assert not Check("none", "", math.inf, math.inf).holds


@pytest.mark.parametrize("part", ["checks", "second_opinion", "gap"])
def test_a_check_that_cannot_be_computed_fails(part):
    """An answer with NaN has no eigenvalues: it is no error of the bench, and no answer."""

    def raising(*_):
        raise np.linalg.LinAlgError("Array must not contain infs or NaNs")

    good = [Check("good", "", 0.0, 1.0)]
    parts = {"checks": lambda *_: good, part: raising}
    found = type("Raising", (Checker,), parts)().certify(math.nan, 1e-6)
    assert not found.holds
    assert "LinAlgError: Array must not contain infs or NaNs" in " ".join(found.failures)


def test_an_error_of_the_workbench_is_no_failure_of_a_check():
    def named(*_):
        raise InputError("the answer has 2 entries, and 3 are needed")

    with pytest.raises(InputError, match="3 are needed"):
        type("Naming", (Checker,), {"checks": named})().certify(1.0, 1e-6)


def test_one_failing_check_among_good_ones_is_named_with_its_place():
    good, bad = Check("good", "", 0, 1), Check("bad", "", 2, 1, where="at 30 Hz")
    assert Certificate((good, bad, good)).failures == ("bad: 2 exceeds 1 at 30 Hz",)


@given(
    st.lists(st.builds(Check, st.text(), st.text(), NUMBERS, NUMBERS, where=st.text()), max_size=3),
    st.none() | st.builds(Gap, st.text(), NUMBERS, NUMBERS, st.booleans()),
)
@example([Check("x", "", math.nan, math.inf), Check("y", "", -math.inf, 0)], None)
@example([Check("peak", "mu", 0.5, 1.0, where="inf")], None)
@example([], Gap("nan", math.nan, 1e-6, True))
def test_a_certificate_survives_json(checks, gap):
    before = Certificate(tuple(checks), gap=gap)
    text = json.dumps(plain(before.to_json()), allow_nan=False)
    after = Certificate.from_json(json.loads(text))
    assert repr(after) == repr(before)  # unlike ==, the same for NaN
    assert (after.holds, after.valid, after.failures) == (
        before.holds,
        before.valid,
        before.failures,
    )


# --- outcomes ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "outcome", "message"),
    [
        ("exact", Outcome.SOLVED, "as good"),
        ("rough", Outcome.SOLVED, ""),
        ("modest", Outcome.SOLVED, "not sure"),
        ("boastful", Outcome.INACCURATE, ""),
        ("lying", Outcome.FAILED, "trust me"),
        ("nan", Outcome.FAILED, ""),
        ("empty", Outcome.FAILED, "where is it"),
        ("unsure", Outcome.FAILED, "stalled"),
        ("nothing", Outcome.FAILED, "None"),
        ("garbage", Outcome.FAILED, ""),
        ("hopeless", Outcome.NO_CLAIM, "there is none"),
        ("raising", Outcome.FAILED, "ArithmeticError: the sky fell"),
    ],
)
def test_the_certificate_sets_the_outcome_whatever_the_method_said(root, name, outcome, message):
    solution = solve(root, method=name)
    assert solution.outcome is outcome
    assert message in solution.message
    assert (solution.outcome is Outcome.SOLVED) == (
        solution.certificate is not None and solution.certificate.holds
    )


def test_a_lie_is_caught_with_its_numbers(root):
    solution = solve(root, method="lying")
    assert solution.claim is Outcome.SOLVED
    assert solution.certificate.failures[0] == "reach: 4 exceeds 1e-09 over all targets"


def test_a_boast_holds_at_a_tolerance_as_coarse_as_its_answer(root):
    assert solve(root, method="boastful", options=Options(tolerance=0.6)).outcome is Outcome.SOLVED
    assert (
        solve(root, method="boastful", options=Options(tolerance=0.4)).outcome is Outcome.INACCURATE
    )


def test_a_method_that_raises_leaves_its_trace(root):
    solution = solve(root, method="raising")
    assert solution.answer is None and solution.certificate is None
    assert "the sky fell" in solution.trace and "Traceback" in solution.trace


def test_a_method_stops_at_the_time_limit(root):
    solution = solve(root, method="patient", options=Options(time_limit=0.02))
    assert solution.outcome is Outcome.TIME_LIMIT
    assert "0.02 s" in solution.message and "of 1000" in solution.message


def late(context):
    """Progress after whose third round the time limit has passed."""

    def progress(description, done, total):
        if done == 3:
            context.started -= 1000.0

    return progress


def test_an_iteration_that_meets_the_time_limit_gives_its_best_so_far(root):
    context = Context(options=Options(time_limit=100.0))
    context.progress = late(context)
    solution = solve(root, method="newton", context=context)
    assert solution.claim is solution.outcome is Outcome.TIME_LIMIT
    assert solution.message == "time limit of 100 s reached after 3 rounds; best so far"
    assert solution.certificate.valid and not solution.certificate.gap.required
    assert 1e-6 < solution.certificate.gap.value < 0.1


def test_an_iteration_that_ends_in_time_is_not_stopped(root):
    solution = solve(root, method="newton", options=Options(time_limit=100.0))
    assert (solution.outcome, solution.message) == (Outcome.SOLVED, "twelve rounds")


@pytest.mark.parametrize(
    ("factor", "outcome"),
    [(1.5, Outcome.TIME_LIMIT), (1.0, Outcome.SOLVED), (0.5, Outcome.FAILED)],
    ids=["valid", "best", "wrong"],
)
def test_what_a_solver_had_when_its_time_was_over_is_checked_too(toy, root, factor, outcome):
    @method(toy.Root, "timed", optimal=True)
    def timed(program, context):
        return factor * toy.roots(program), Outcome.TIME_LIMIT, "out of time"

    assert solve(root, method="timed").outcome is outcome


def test_a_method_that_panics_has_failed(toy):
    class Panic(BaseException):
        """As a Rust panic arrives from a solver that is called directly: no Exception."""

    @method(toy.Root, "panicking", optimal=True)
    def panicking(program, context):
        raise Panic("index out of range")

    solution = solve(toy.Root((1.0,)), method="panicking")
    assert solution.outcome is Outcome.FAILED
    assert solution.message == "Panic: index out of range"


def test_an_interrupt_is_not_swallowed(root):
    with pytest.raises(KeyboardInterrupt):
        solve(root, method="interrupted")


@pytest.mark.parametrize("name", ["exact", "rough", "random"])
def test_times_are_booked(root, name):
    seconds = solve(root, method=name).seconds
    assert seconds.keys() == {"statement", "solve", "check"}
    assert all(value >= 0 for value in seconds.values())


def test_the_statement_is_booked_apart_from_the_solve(toy):
    @method(toy.Root, "stating", optimal=False)
    def stating(program, context):
        with context.stating():
            for _ in range(20_000):
                pass
        return toy.roots(program), Outcome.SOLVED, ""

    seconds = solve(toy.Root((1.0,)), method="stating").seconds
    assert seconds["statement"] > seconds["solve"] >= 0


@pytest.mark.parametrize("same", [True, False])
def test_the_seed_decides_random_answers(root, same):
    one, two = (
        solve(root, method="random", options=Options(seed=s)).answer for s in (3, 3 if same else 4)
    )
    assert np.array_equal(one, two) is same


# --- choosing a method ------------------------------------------------------------------------


def test_the_default_method_answers_where_none_is_named(root):
    assert find_method(root, None).name == "exact"
    assert solve(root).message == "as good as it gets"


def test_an_unknown_method_suggests_the_nearest(root):
    with pytest.raises(UnknownNameError, match=r"no method of Root is called 'exat'.*exact"):
        solve(root, method="exat")


def test_an_unfit_method_gives_its_reason(toy, root):
    assert solve(root, method="picky").outcome is Outcome.SOLVED
    with pytest.raises(InputError, match="'picky' cannot take this Root: it counts to three"):
        solve(toy.Root((1.0,) * 4), method="picky")


def test_help_is_the_first_line_of_the_docstring(toy):
    assert methods(toy.Root)["exact"].help == "The square root."
    assert methods(toy.Root)["nothing"].help == ""


def test_methods_are_inherited_and_overridden(toy):
    class Cube(toy.Root):
        pass

    @method(Cube, "rough", optimal=True)
    def rough(program, context):
        """Its own."""

    assert methods(Cube).keys() == methods(toy.Root).keys()
    assert methods(Cube)["rough"].help == "Its own."
    assert methods(toy.Root)["rough"].help != "Its own."


def test_a_conic_method_is_registered_for_every_installed_solver(toy):
    class Cone(toy.Root):
        pass

    @conic_method(Cone)
    def cone(program, context, solver):
        return toy.roots(program), Outcome.SOLVED, solver.name

    for solver in conic_solvers():
        assert methods(Cone)[solver.name].optimal
        assert solve(Cone((4.0,)), method=solver.name).message == solver.name


def test_a_method_does_not_replace_another_silently(toy):
    class Cube(toy.Root):
        pass

    @method(Cube, "fast", optimal=True)
    def first(program, context):
        """The first."""

    def second(program, context):
        """The second."""

    with pytest.raises(RegistryError, match="two methods of Cube are called 'fast'") as error:
        method(Cube, "fast", optimal=True)(second)
    for words in ("first", "second", f"{__file__}:{second.__code__.co_firstlineno}"):
        assert words in str(error.value)
    assert methods(Cube)["fast"].help == "The first."


def test_two_conic_statements_of_one_program_clash(toy):
    class Cone(toy.Root):
        pass

    def primal(program, context, solver): ...
    def dual(program, context, solver): ...

    conic_method(Cone)(primal)
    conic_method(Cone)(primal)
    with pytest.raises(RegistryError, match=r"primal .* and .*dual "):
        conic_method(Cone)(dual)


def test_a_function_that_is_defined_again_takes_its_former_place(toy):
    class Cube(toy.Root):
        pass

    for words in ("Before.", "After."):

        @method(Cube, "fast", optimal=True)
        def fast(program, context): ...

        fast.__doc__ = words
    assert methods(Cube)["fast"].answer is fast


METHOD = """
from workbench.geometry.circle import SmallestCircle
from workbench.program import method
@method(SmallestCircle, "guess", optimal=False)
def {name}(program, context):
    "{words}"
"""


def test_an_edited_file_registers_its_methods_on_a_library_program_anew(project):
    from workbench.bench.project import registry
    from workbench.geometry.circle import SmallestCircle

    root = project.toy.read_text() + METHOD.format(name="guess", words="Before.")
    project.toy.write_text(root)
    registry().find("toy/root")
    assert methods(SmallestCircle)["guess"].help == "Before."
    project.toy.write_text(root.replace("Before.", "After it was edited."))
    registry().find("toy/root")
    assert methods(SmallestCircle)["guess"].help == "After it was edited."
    project.toy.write_text(root.replace("def guess", "def other").replace("Before.", "Renamed."))
    registry().find("toy/root")
    assert methods(SmallestCircle)["guess"].help == "Renamed."


def test_a_file_of_problems_may_not_replace_a_method_of_the_library(project):
    from workbench.bench.project import registry
    from workbench.geometry.circle import SmallestCircle

    before = methods(SmallestCircle)["exact"]
    text = METHOD.format(name="mine", words="Mine.").replace('"guess"', '"exact"')
    project.toy.write_text(project.toy.read_text() + text)
    with pytest.raises(RegistryError, match=r"two methods of SmallestCircle are called 'exact'"):
        registry().find("toy/root")
    assert methods(SmallestCircle)["exact"] is before


def test_a_study_has_no_methods(toy):
    with pytest.raises(InputError, match="study: it has no method 'exact'"):
        solve(toy.Total(()), method="exact")


def test_an_answer_that_is_a_dataset_is_stored_as_it_is():
    class Plain(Program):
        def checks(self, answer, tolerance):
            return []

        def metrics(self, answer):
            return {}

    data = xr.Dataset({"x": 1.0})
    assert Plain().to_dataset(data) is Plain().from_dataset(data) is data
    assert Plain().figures(data) == Plain().tables(data) == {}
    with pytest.raises(InputError, match="to_dataset and from_dataset: its answer is a float"):
        Plain().to_dataset(1.0)


def test_only_programs_and_studies_are_answered():
    with pytest.raises(InputError, match=r"a Study or a cvxpy\.Problem is needed, not int"):
        solve(3)


def test_a_study_is_certified_by_its_own_checks(toy):
    solution = solve(toy.Total(()))  # nothing to sum: the total is 0
    assert solution.outcome is Outcome.SOLVED
    assert [check.name for check in solution.certificate.checks] == ["positive"]


def test_a_context_may_be_handed_in(root):
    context = Context(options=Options(tolerance=0.6))
    assert solve(root, method="boastful", context=context).outcome is Outcome.SOLVED


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([1.0, 3.0, 2.0], (3.0, "at (1,)")),
        ([[1.0, 2.0], [5.0, 4.0]], (5.0, "at (1, 0)")),
        (-math.inf, (-math.inf, "at (0,)")),
    ],
)
def test_the_worst_value_and_its_place(values, expected):
    assert worst_value(values, lambda place: f"at {place}") == expected


def test_nan_is_worse_than_anything():
    value, place = worst_value([1.0, math.nan, 2.0], str)
    assert math.isnan(value) and place == "(1,)"


# --- what a method must return ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("returned", "words"),
    [
        (None, "returned None; it must return three things: its answer (Circle) or None"),
        ((1.0, 2.0), "returned (float, float); it must return three things"),
        (({}, Outcome.SOLVED, ""), "returned a dict, and Circle is needed"),
    ],
)
def test_a_method_that_returns_something_else_is_told_what_is_needed(returned, words, monkeypatch):
    from workbench.geometry import SmallestCircle

    program = SmallestCircle([[0, 2, 4, 2 + 1j]])
    monkeypatch.setattr("workbench.program._METHODS", {SmallestCircle: {}})
    method(SmallestCircle, "wrong", optimal=False)(lambda program, context: returned)
    solution = solve(program, method="wrong")
    assert solution.outcome is Outcome.FAILED
    assert "method 'wrong' of SmallestCircle" in solution.message and words in solution.message
    assert SmallestCircle.answer_type() == "Circle" and Program.answer_type() == "Dataset"
