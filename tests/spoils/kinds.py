"""What stored variables are of which a spoil may go unnoticed; all others are checked."""

from __future__ import annotations

import re
from typing import NamedTuple

ANSWER = "the answer"
ABOVE = "a bound from above"
BELOW = "a bound from below"
PROOF = "a proof"
TOLD = "as told"

MEANINGS = {
    ANSWER: "what was designed or found. A changed value that passes the checks is another valid "
    "answer, and every number is computed from it again.",
    ABOVE: "a larger value is true as well; a smaller one is caught.",
    BELOW: "a smaller value is true as well; a larger one is caught.",
    PROOF: "multipliers, shapes or perturbations that prove a number. Changed ones that pass prove "
    "the same number; its distance from the best one is computed from them again.",
    TOLD: "traces of an iteration, and what a method says about itself. They are not checked and "
    "appear in no metric and in no exported file; a table that shows them says so.",
}


class Free(NamedTuple):
    """Names of variables of a Program, as a pattern, and what they are."""

    pattern: str
    kind: str


CONTROLLER = Free("controller_[ABCD]", ANSWER)
ROOTS = Free("(zeros|poles|gain)", ANSWER)
MODELS = Free("(predictor|simulator)_.*", ANSWER)
HINF = (CONTROLLER, Free("norm|gamma", ABOVE), Free("least|reached|slope", TOLD))
COVER = (Free("nominal_[AB]|W_[12]_[ABCD]|left|right", ANSWER), Free("weights|of_loop", PROOF))
FREE: dict[str, tuple[Free, ...]] = {
    "MuUpperBound": (Free("value", ABOVE), Free("Delta", PROOF)),
    "MuLowerBound": (Free("mu_lower", BELOW),),
    "HinfSynthesis": HINF,
    "H2Synthesis": (CONTROLLER, Free("norm", ABOVE), Free("least", TOLD)),
    "H2HinfSynthesis": (
        CONTROLLER,
        Free("norm|hinf_norm", ABOVE),
        Free("least|bound", TOLD),
    ),
    "LoopShaping": HINF,
    "MixedSensitivity": HINF,
    "MuSynthesis": (
        CONTROLLER,
        Free("peak", ABOVE),
        Free("peak_omega|round_.*", TOLD),
        Free("proven_proof_.*", PROOF),
    ),
    "FaultEstimation": (
        Free("filter_[ABCD]", ANSWER),
        Free("peak", ABOVE),
        Free("round_.*", TOLD),
        Free("proven_[0-9]+_(proof_.*|Delta)", PROOF),
    ),
    "SwitchedStability": (Free("P", PROOF), Free("dwell", ABOVE)),
    "MagnitudeFit": (ROOTS,),
    "ResponseFit": (ROOTS,),
    "CircleCover": (Free("W_c_.*|(second|third)_angle", ANSWER),),
    "StadiumCover": (Free("W_[cr]_.*", ANSWER),),
    "CrestFactor": (Free("phase", ANSWER),),
    "StateSpaceFit": (MODELS, Free("validation_fit|candidate_.*|fit_of_average", TOLD)),
    "ClosedLoopFit": (MODELS, Free("validation_fit|candidate_.*|fit_of_average", TOLD)),
    "MatrixSets": (Free("left|right", ANSWER), Free("weights", PROOF)),
    "MatrixCover": COVER,
    "FeedbackFromRecords": (Free("level", ABOVE), Free("bound", BELOW)),
    "ExperimentDesign": (Free("worst", ABOVE),),
    "Implementation": (Free("sensitivity|rounding_share|contraction", ABOVE),),
}


def kind_of(program: str, variable: str) -> str:
    """What a variable of a Program is; empty where every spoil of it is caught."""
    for free in FREE.get(program, ()):
        if re.fullmatch(free.pattern, variable):
            return free.kind
    return ""
