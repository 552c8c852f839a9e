"""Every Program of the library has at least three methods of really different mathematics."""

import importlib
from inspect import isabstract

import pytest

from workbench.program import _METHODS, Program, methods
from workbench.solvers import conic_solvers

SPLITTING = "operator splitting on cones"
SOLVERS = {
    "clarabel": "interior points of cones", "cvxopt": "interior points of cones", "scs": SPLITTING,
}  # fmt: skip
NONLINEAR = {"ipopt": "interior points of a nonlinear program"}
COVERS = {
    "steps": "a fit to centres",
    "joint": "quasi-Newton descent of the mean square size",
    "inflation": "quasi-Newton descent of the largest ratio to the raw sets",
}
MATHEMATICS = {
    "ConicProgram": SOLVERS,
    "CvxpyProgram": SOLVERS,
    "SmallestCircle": SOLVERS | NONLINEAR | {"exact": "exchange", "thesis": "shrinking"},
    "NarrowestStadium": SOLVERS | NONLINEAR | {"exact": "calipers", "thesis": "candidates"},
    "SmallestAreaStadium": NONLINEAR
    | {"search": "golden sections", "evolution": "a population", "narrowest": "calipers"},
    "MagnitudeFit": SOLVERS
    | NONLINEAR
    | {
        "minimax": "linear programs",
        "sk": "reweighted least squares",
        "sb10yd": "least squares",
        "best": "",
    },
    "ResponseFit": SOLVERS
    | NONLINEAR
    | {"vector-fitting": "relocation of poles", "sb10yd": "least squares", "best": ""},
    "CircleCover": SOLVERS | COVERS,
    "StadiumCover": SOLVERS | COVERS,
    "MatrixSets": SOLVERS | {"barrier": "interior points along geodesics"},
    "MatrixCover": {
        "steps": "linear programs and one semidefinite program",
        "joint": "semidefinite programs for both weights",
        "descent": "quasi-Newton descent over poles and zeros",
        "evolution": "a population",
    },
    "MuUpperBound": SOLVERS | {"ab13md": "a barrier", "fast": "balancing, interior points"},
    "MuLowerBound": NONLINEAR | {"power": "power iteration", "gain": "vertices", "best": ""},
    "HinfSynthesis": SOLVERS
    | {
        "riccati": "Riccati equations",
        "sb10ad": "Riccati equations",
        "fixed": "",
        "bfgs": "quasi-Newton descent and sampled gradients",
        "smoothed": "interior points on power means",
        "evolution": "a population",
        "trust_region": "nonsmooth descent",
    },
    "H2Synthesis": SOLVERS
    | {
        "riccati": "Riccati equations",
        "sb10hd": "Riccati equations",
        "fixed": "quasi-Newton descent",
    },
    "H2HinfSynthesis": SOLVERS | {"fixed": "nonsmooth descent"},
    "LoopShaping": SOLVERS
    | {
        "riccati": "Riccati equations",
        "sb10ad": "Riccati equations",
        "coprime": "a closed form of the level",
        "fixed": "",
        "bfgs": "quasi-Newton descent and sampled gradients",
        "smoothed": "interior points on power means",
        "evolution": "a population",
        "trust_region": "nonsmooth descent",
    },
    "MuSynthesis": {
        "dk": "complex multipliers",
        "mu-dk": "the complex bound turned into the mixed one",
        "dgk": "mixed multipliers",
        "fixed": "nonsmooth descent",
    },
    "Implementation": {
        "tustin": "the trapezoidal rule",
        "zoh": "an exact answer to steps",
        "foh": "an exact answer to ramps",
        "best": "",
    },
    "FaultEstimation": SOLVERS
    | {
        "riccati": "Riccati equations",
        "dk": "complex multipliers",
        "mu-dk": "the complex bound turned into the mixed one",
        "dgk": "mixed multipliers",
        "basis": "convex steps over a basis",
    },
    "FeedbackFromRecords": SOLVERS | {"riccati": "Riccati equations of a game"},
    "SwitchedStability": SOLVERS | {"descent": "quasi-Newton descent"},
    "ExperimentDesign": SOLVERS | NONLINEAR,
    "CrestFactor": NONLINEAR | {"schroeder": "a closed form", "clipping": "clipping"},
    "ParameterFit": NONLINEAR | {"scipy": "Gauss-Newton steps", "evolution": "a population"},
    "RationalModelFit": NONLINEAR
    | {
        "levenberg-marquardt": "Gauss-Newton steps without numerators",
        "instruments": "linear regressions with instruments",
    },
    "StateSpaceFit": {
        "subspace": "a long autoregression",
        "moesp": "projections",
        "n4sid": "projections",
        "cva": "projections",
        "prediction-error": "descent of prediction errors",
        "armax": "descent of prediction errors",
        "output-error": "descent of prediction errors",
        "box-jenkins": "descent of prediction errors",
        "arx": "a short autoregression",
        "impulse-response": "a kernel",
        "best": "",
        "averaged": "",
    },
}
"""What each method is, by Program; a combination of other methods counts as nothing of its own."""
MATHEMATICS["ClosedLoopFit"] = MATHEMATICS["StateSpaceFit"] | {
    "direct": "descent of prediction errors",
    "two-stage": "a response to the excitation",
    "instrumental-variables": "instruments",
    "indirect": "a loop that is opened",
}
MATHEMATICS["MixedSensitivity"] = MATHEMATICS["HinfSynthesis"]


def programs(base=Program):
    """The Programs of the library that have methods."""
    for each in base.__subclasses__():
        if each.__module__.startswith("workbench.") and ".plants." not in each.__module__:
            if methods(each) and not isabstract(each):
                yield each
            yield from programs(each)


ROOMS = (
    "conic", "diagnosis", "fitting", "geometry", "identification", "mu", "synthesis", "uncertainty",
)  # fmt: skip
for room in ROOMS:  # their names are imported when they are first asked for
    module = importlib.import_module(f"workbench.{room}")
    for name in dir(module):
        getattr(module, name)
LIBRARY = sorted(set(programs()), key=lambda each: each.__name__)


@pytest.mark.parametrize("program", LIBRARY, ids=lambda each: each.__name__)
def test_a_program_has_three_methods_of_different_mathematics(program):
    known = MATHEMATICS[program.__name__]
    other = set(methods(program)) ^ set(known)
    assert not other, f"say in MATHEMATICS of this file what each method is: {sorted(other)}"
    if known is SOLVERS:  # its methods are codes, not ideas
        assert len(known) >= 3
        return
    assert len({known[name] for name in methods(program)} - {""}) >= 3


def test_every_program_with_methods_is_looked_at():
    named = {kind.__name__ for kind in _METHODS if kind.__module__.startswith("workbench.")}
    assert named <= {each.__name__ for each in LIBRARY} == set(MATHEMATICS)
    assert {solver.name for solver in conic_solvers()} == set(SOLVERS)
