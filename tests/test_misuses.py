"""Wrong input at every joint from a record to a processor: each says what was given.

Every argument gets what people give by mistake: a text, nothing, a number that is none, another
object. Whatever is refused must be refused by the workbench, in words that name the argument, the
value or what it is.
"""

import math

import control
import numpy as np
import pytest
from tables import hold

import workbench as wb
from workbench.conic import ConicProgram
from workbench.errors import WorkbenchError
from workbench.identification import ResponseEstimate, read_record, read_response
from workbench.mu import conditions, peak, upper_bound
from workbench.solvers import Options
from workbench.structure import Complex, Full, Real, Structure
from workbench.synthesis import (
    PI,
    H2HinfSynthesis,
    H2Synthesis,
    HinfSynthesis,
    Implementation,
    LoopShaping,
    MixedSensitivity,
    MuSynthesis,
    ObserverForm,
    Parametrised,
    Sparse,
    export,
    lqg,
    reduce_order,
    sampled_conditions,
)
from workbench.systems import bandwidths
from workbench.uncertainty import (
    CircleCover,
    GeneralisedPlant,
    Responses,
    StadiumCover,
    UncertaintyModel,
    generalised_plant,
)

OMEGA = np.geomspace(1.0, 10.0, 12)
VALUES = np.outer(1 / (1 + 1j * OMEGA), [1.0, 1.1, 0.9])
PLANTS = Responses(omega=OMEGA, values=VALUES)
LAG = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
MODEL = UncertaintyModel(control.tf([1], [1, 1]), control.tf([0.1, 0.1], [0.1, 1]))
LOOP = generalised_plant(
    [(MODEL, "u", "y"), (control.tf([1], [1, 0.1]), "e", "z"), (0.1, "u", "v")],
    {"e": "r - y"},
    exogenous="r",
    control="u",
    performance=["z", "v"],
    measurement="e",
)
MIXED = generalised_plant(
    [(LAG, "v", "x")],
    {"v": "u + d + delta", "y": "x + n"},
    perturbation=[(Full(1, 1), "u", "delta")],
    exogenous=["d", "n"],
    control="u",
    performance=["x", "u"],
    measurement="y",
)
SAMPLED = control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], 0.1)
ESTIMATES = [
    ResponseEstimate(OMEGA, VALUES[:, k].reshape(-1, 1, 1), np.full((12, 1, 1), 1e-6), 10.0)
    for k in range(2)
]
STRUCTURE = Structure([Complex(1), Real(1)])

NOT_A_NUMBER = ("fast", math.nan, [1.0, 2.0], {})
NOT_POSITIVE = (*NOT_A_NUMBER, 0.0, -1.0, math.inf)
NOT_A_COUNT = (*NOT_A_NUMBER, -1, 1.5)
NO_FORM = {
    "family": ("pid", object()),
    "random": (-1, 1.5, "many"),
    "order": NOT_A_COUNT,
    "stable": ("yes", 1, None),
    "fastest_pole": NOT_POSITIVE,
    "largest_gain": NOT_POSITIVE,
    "further_plants": (None, "plants", object(), (1,), (None,)),
}
"""What cannot be asked of a controller."""
NO_ROWS = (None, "pi", [], [[]], [[None]], [[1]], [["pi"]], [[PI()], [PI(), PI()]], [[PI]])
NO_PARAMETERS = (None, "near", [], 1.0, [math.nan, 1.0], [[1.0, 2.0]], [1j, 2.0], {})
NOT_AN_OBJECT = (None, "plant", object(), int)
NOT_A_SYSTEM = ("plant", object(), int, [[math.nan]])
NOT_A_NAME = ("nonsense", 7)

# What is called, with arguments that are right, and what is wrong of each of them.
JOINTS = {
    "Responses": (
        Responses,
        {"omega": OMEGA, "values": VALUES},
        {
            "omega": ("fast", None, [1.0, 2.0], -OMEGA, OMEGA[::-1], [1, 2, 3, math.nan], 5.0),
            "values": (None, "fast", VALUES[:2], VALUES[:, :1], VALUES * math.nan, 5.0),
            "plants": (["a"], ["a", "a", "b"], 3),
            "present": ([True], "all"),
            "variance": (-1.0, [1.0, 2.0], "small", math.nan),
            "degrees": (0, -1.0, math.nan),
            "known": ([LAG], [LAG * 2, None, None]),
        },
    ),
    "Responses.within": (
        PLANTS.within,
        {"low_hz": 0.1, "high_hz": 10.0},
        {"low_hz": (*NOT_A_NUMBER, 20.0), "high_hz": (*NOT_A_NUMBER, 0.01)},
    ),
    "Responses.from_frd": (
        Responses.from_frd,
        {"systems": [control.frd(LAG, OMEGA), control.frd(LAG * 2, OMEGA)]},
        {
            "systems": ([], [LAG, LAG], control.frd(LAG, OMEGA), [control.frd(LAG, OMEGA)], None),
            "input": ("torque", 3, 1.5),
            "output": ("speed", -1),
        },
    ),
    "Responses.from_estimates": (
        Responses.from_estimates,
        {"estimates": ESTIMATES},
        {
            "estimates": ([], ESTIMATES[0], [ESTIMATES[0]], [LAG, LAG], None),
            "input": (3, "torque"),
            "output": (3, "speed"),
        },
    ),
    "Responses.from_files": (
        Responses.from_files,
        {"files": "{records}/drive*.csv", "input": "torque", "output": "speed", "time": "t"},
        {
            "files": ("{records}/nothing*.csv", "nowhere/*.csv", ["{records}/drive1.csv"], 7, None),
            "input": ("torqe", None, 3),
            "output": ("sped", None),
            "time": ("clock",),
            "dt": (-1.0, 0.0, math.nan, "fast"),
            "most": (0, 1, "all"),
            "frequency": ("f",),
        },
    ),
    "read_record": (
        read_record,
        {"file": "{records}/drive1.csv", "inputs": ["torque"], "outputs": ["speed"], "time": "t"},
        {
            "file": ("{records}/missing.csv", "{records}", 7, None, "{records}/drive1.xyz"),
            "inputs": (["torqe"], [], 3, None),
            "outputs": (["sped"], [], None),
            "time": ("clock",),
        },
    ),
    "read_response": (
        read_response,
        {"file": "{records}/curve.csv", "frequency": "f", "response": "G"},
        {
            "file": ("{records}/missing.csv", "{records}/drive1.csv", 7),
            "frequency": ("g", None),
            "response": ("H", ("a", "b"), None),
        },
    ),
    "StadiumCover": (
        StadiumCover,
        {"responses": PLANTS, "order": 1, "complex_order": 1},
        {
            "responses": (*NOT_AN_OBJECT, VALUES),
            "order": (*NOT_A_COUNT, None),
            "zeros": ("many", -2, 9),
            "complex_order": NOT_A_COUNT,
            "real_order": NOT_A_COUNT,
            "form": NOT_A_NAME,
            "nominal": ("plant", object()),
            "unstable_poles": (*NOT_A_COUNT, 5),
            "leave_out": (*NOT_A_COUNT, 9),
            "confidence": ("sure", 0.0, 1.0, -1.0, 95, math.nan, 0.95),
        },
    ),
    "CircleCover": (
        CircleCover,
        {"responses": PLANTS, "order": 1, "complex_order": 1},
        {
            "responses": NOT_AN_OBJECT,
            "order": (*NOT_A_COUNT, None),
            "complex_order": NOT_A_COUNT,
            "form": NOT_A_NAME,
        },
    ),
    "UncertaintyModel": (
        UncertaintyModel,
        {"nominal": LAG, "W_c": LAG},
        {
            "nominal": (*NOT_AN_OBJECT, SAMPLED, control.append(LAG, LAG)),
            "W_c": (*NOT_AN_OBJECT, SAMPLED, control.append(LAG, LAG)),
            "W_r": ("weight", object(), SAMPLED),
            "form": NOT_A_NAME,
        },
    ),
    "generalised_plant": (
        generalised_plant,
        {
            "blocks": [(LAG, "u", "y")],
            "sums": {"e": "r - y"},
            "exogenous": "r",
            "control": "u",
            "performance": "e",
            "measurement": "y",
        },
        {
            "blocks": (
                None,
                [],
                [LAG],
                [(LAG, "u")],
                [(None, "u", "y")],
                [("G", "u", "y")],
                [(LAG, ["u", "w"], "y")],
                [(LAG, "u", "y"), (LAG, "u", "y")],
                "plant",
            ),
            "sums": (None, {"e": "r - z"}, {"e": "r -"}, {"y": "r"}, {"e": 3}, "e = r - y"),
            "exogenous": ("w", 3, ["r", "r"]),
            "control": ("v", 3),
            "performance": ("zz", 3),
            "measurement": ("w", 3),
            "perturbation": ("delta", [(Real(1), "y")], [(Real(1), "a", "b")], [("d", "y", "u")]),
        },
    ),
    "GeneralisedPlant": (
        GeneralisedPlant,
        {"system": control.append(LAG, LAG), "structure": None, "controls": 1, "measurements": 1},
        {
            "system": (*NOT_AN_OBJECT, 3.0),
            "structure": ("blocks", [Real(1)], Structure([Full(5, 5)])),
            "controls": (*NOT_A_COUNT, 9),
            "measurements": (*NOT_A_COUNT, 9),
        },
    ),
    "Structure": (
        Structure,
        {"blocks": [Real(1)]},
        {"blocks": (None, "real", [1, 2], [Real], 3)},
    ),
    "MuSynthesis": (
        MuSynthesis,
        {"plant": LOOP},
        {
            "plant": (*NOT_AN_OBJECT, LAG, GeneralisedPlant(control.append(LAG, LAG), None, 1, 1)),
            "structure": ("blocks", Structure([Full(7, 7)])),
            "start": (
                "K",
                object(),
                control.ss([], [], [], np.eye(3)),
                control.ss([], [], [], [[-500.0]]),
            ),
            "target": NOT_POSITIVE,
        }
        | NO_FORM,
    ),
    "HinfSynthesis": (
        HinfSynthesis,
        {"plant": LOOP},
        {"plant": (*NOT_AN_OBJECT, LAG), "gamma": NOT_POSITIVE} | NO_FORM,
    ),
    "H2Synthesis": (
        H2Synthesis,
        {"plant": LOOP},
        {"plant": (*NOT_AN_OBJECT, LAG)} | NO_FORM,
    ),
    "H2HinfSynthesis": (
        H2HinfSynthesis,
        {"plant": MIXED, "gamma": 2.0},
        {"plant": (*NOT_AN_OBJECT, LAG, LOOP.nominal()), "gamma": NOT_POSITIVE} | NO_FORM,
    ),
    "Sparse": (Sparse, {"rows": [[PI(), None], [None, PI()]]}, {"rows": NO_ROWS}),
    "ObserverForm": (ObserverForm, {"model": LAG}, {"model": (None, *NOT_A_SYSTEM)}),
    "Parametrised": (
        Parametrised,
        {"matrices": lambda x: ([[-1.0]], [[1.0]], [[x[0]]], [[x[1]]]), "near": [1.0, 2.0]},
        {"matrices": (None, "x", 1, lambda x: x, lambda x: (x, x, x)), "near": NO_PARAMETERS},
    ),
    "lqg": (
        lqg,
        {"plant": LAG, "Q": 1.0, "R": 1.0, "W": 1.0, "V": 1.0},
        {
            "plant": (None, *NOT_A_SYSTEM),
            "Q": (None, "much", -1.0, [[1.0, 2.0]], float("nan")),
            "R": (None, "much", 0.0, [[1.0, 2.0]], float("inf")),
            "W": (None, "much", -1.0, [[1.0, 2.0]], float("nan")),
            "V": (None, "much", 0.0, [[1.0, 2.0]], float("nan")),
            "recovery": (None, "much", -1.0, float("nan"), float("inf")),
        },
    ),
    "MixedSensitivity": (
        MixedSensitivity,
        {"nominal": LAG, "W_S": LAG, "W_KS": 0.1},
        {"nominal": (None, *NOT_A_SYSTEM), "W_S": NOT_A_SYSTEM, "W_KS": NOT_A_SYSTEM} | NO_FORM,
    ),
    "LoopShaping": (
        LoopShaping,
        {"nominal": LAG},
        {"nominal": (None, *NOT_A_SYSTEM)},
    ),
    "Implementation": (
        Implementation,
        {"controller": LAG, "plant": LAG, "dt": 0.1},
        {
            "controller": (None, *NOT_A_SYSTEM, control.append(LAG, LAG)),
            "plant": (None, *NOT_A_SYSTEM, control.append(LAG, LAG)),
            "dt": NOT_POSITIVE,
            "delay_samples": (*NOT_A_NUMBER, -1.0, math.inf),
            "precision": NOT_A_NAME,
            "order": NOT_A_COUNT,
            "anti_aliasing": ("filter", object(), SAMPLED),
            "limits": ("wide", (1.0, 0.0), (0.0, 1.0, 2.0), 5.0),
            "sign": (0, 2, "negative"),
        },
    ),
    "Implementation, fixed": (
        Implementation,
        {
            "controller": LAG,
            "plant": LAG,
            "dt": 0.1,
            "precision": "fixed",
            "full_scale": (1.0, 1.0),
        },
        {
            "bits": (*NOT_A_NUMBER, 1, 99),
            "signal_bits": (*NOT_A_NUMBER, 1, 99),
            "full_scale": (None, "one", (0.0, 1.0), (1.0,), (1.0, math.nan), 3.0),
        },
    ),
    "reduce_order": (
        reduce_order,
        {"controller": LAG, "plant": LOOP, "order": 1},
        {"controller": (None, *NOT_A_SYSTEM), "plant": NOT_AN_OBJECT, "order": NOT_A_COUNT},
    ),
    "sampled_conditions": (
        sampled_conditions,
        {"plant": MODEL, "controller": SAMPLED, "dt": 0.1},
        {
            "plant": (*NOT_AN_OBJECT, SAMPLED),
            "controller": (None, *NOT_A_SYSTEM, SAMPLED.sample),
            "dt": NOT_POSITIVE,
            "delay_samples": (*NOT_A_NUMBER, -1.0),
            "sign": (0, "negative"),
        },
    ),
    "export": (
        export,
        {"controller": SAMPLED, "path": "{records}/controller.h", "format": "c"},
        {
            "controller": (None, *NOT_A_SYSTEM, LAG),
            "path": (None, 7, "{records}", "{records}/missing/controller.h"),
            "format": NOT_A_NAME,
            "name": ("3 controllers", 7),
            "precision": NOT_A_NAME,
            "limits": ("wide", (0.0, 1.0, 2.0), (1.0, 0.0), 5.0),
        },
    ),
    "conditions": (
        conditions,
        {"plant": LOOP, "controller": control.ss([], [], [], [[0.1]])},
        {
            "plant": (*NOT_AN_OBJECT, LAG),
            "controller": (*NOT_A_SYSTEM, control.ss([], [], [], np.eye(4))),
        },
    ),
    "peak": (
        peak,
        {"system": control.append(LAG, LAG), "structure": STRUCTURE},
        {
            "system": (*NOT_AN_OBJECT, LAG, control.append(LAG, LAG, LAG)),
            "structure": (None, "blocks", [Real(1)]),
        },
    ),
    "upper_bound": (
        upper_bound,
        {"M": np.eye(2), "structure": STRUCTURE},
        {
            "M": (None, "matrix", np.eye(3), np.full((2, 2), math.nan), 3.0, [[1, 2], [3]]),
            "structure": (None, "blocks", [Real(1)]),
            "method": NOT_A_NAME,
        },
    ),
    "bandwidths": (
        bandwidths,
        {"loop": LAG},
        {"loop": NOT_AN_OBJECT, "frequency_hz": ("all", [-1.0, 1.0], [math.nan], [])},
    ),
    "solve": (
        wb.solve,
        {"task": HinfSynthesis(LOOP)},
        {
            "task": (*NOT_AN_OBJECT, LAG, ConicProgram),
            "method": ("ricati", 7),
            "options": ("fine", {"tolerance": 1e-6}, 1e-6),
        },
    ),
    "Options": (
        Options,
        {},
        {
            "tolerance": ("rough", 0.0, -1.0, math.nan, None, [1]),
            "time_limit": ("long", 0.0, -1.0, math.nan),
            "seed": (-1, 1.5, "lucky"),
        },
    ),
}
MISUSES = {
    f"{joint}, {name}: {value!r} ({k})": (joint, name, value)
    for joint, (_, _, wrong) in JOINTS.items()
    for name, values in wrong.items()
    for k, value in enumerate(values)
}


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """Three records of a servo and a response."""
    folder = tmp_path_factory.mktemp("records")
    rng = np.random.default_rng(1)
    for k in range(1, 4):
        u = np.tile(rng.standard_normal(50), 4)
        y = np.zeros(200)
        for n in range(1, 200):
            y[n] = 0.5 * y[n - 1] + k * u[n - 1]
        table = np.column_stack([np.arange(200) * 0.01, u, y])
        np.savetxt(
            folder / f"drive{k}.csv", table, delimiter=",", header="t,torque,speed", comments=""
        )
    curve = np.column_stack([OMEGA, VALUES[:, 0].real, VALUES[:, 0].imag])
    np.savetxt(folder / "curve.csv", curve, delimiter=",", header="f,G_re,G_im", comments="")
    return folder


def filled(value, records):
    """A value with the folder of the records in it."""
    if isinstance(value, str):
        return value.replace("{records}", str(records))
    if isinstance(value, list) and value and isinstance(value[0], str):
        return [filled(one, records) for one in value]
    return value


def room_of(function):
    """The room of the library in which a function, a method or a class stands."""
    return function.__module__.split(".")[1]


@pytest.mark.cases(None)
@pytest.mark.parametrize("room", sorted({room_of(function) for function, _, _ in JOINTS.values()}))
def test_misuses_of_a_room_are_told(room, records):
    def told(misuse):
        joint, name, value = misuse
        function, right, _ = JOINTS[joint]
        arguments = {key: filled(one, records) for key, one in ({**right, name: value}).items()}
        with pytest.raises(WorkbenchError) as error:
            function(**arguments)
        assert 15 < len(str(error.value)) < 800

    here = {case: one for case, one in MISUSES.items() if room_of(JOINTS[one[0]][0]) == room}
    hold(told, {case: {"misuse": misuse} for case, misuse in here.items()})


def test_there_are_many():
    assert len(MISUSES) >= 300
