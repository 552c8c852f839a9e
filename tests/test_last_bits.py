"""No verdict hangs on the last bits: of stored answers, and of the data that they answer.

The data, or the answer, of one stored run of each kind are changed in the last bit of every number;
the certificate must hold all the same.
"""

import functools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from last_bits import shaken

import workbench as wb
from workbench.bench.project import registry
from workbench.bench.results import Run, rebuilt
from workbench.bench.verify import finished_folders
from workbench.certify.mu_bound import certified_bound
from workbench.program import Program, find_method

REFERENCE = Path(__file__).parents[1] / "results" / "reference"
FAST = [
    "cd/focus/circles",
    "cd/radial/residuals",
    "cd/radial/stadiums",
    "quick/distillation/mu-lower",
    "quick/distillation/mu-upper",
    "quick/eight-lines/crest-factor",
    "quick/half-order/magnitude-fit",
    "quick/half-order/response-fit",
    "quick/oscillators/dwell",
    "quick/two-masses/fault-filter",
    "quick/unstable-first-order/hinf",
    "textbook/delay/rational-model",
    "textbook/experiment-design",
    "textbook/fault-detection",
    "textbook/h2/record-feedback",
    "two-by-two/matrix-cover",
]
"""A stored problem of each kind of Program whose certificate takes little, and of two Studies."""
OTHERS = [
    "bench/cd-arm",
    "bench/covers",
    "bench/geometry",
    "bench/matrix-sets",
    "bench/mu",
    "bench/mu-lower-yardstick",
    "bench/mu-yardstick",
    "bench/norms",
    "bench/synthesis",
    "cd/disc-servo",
    "cd/drives",
    "cd/focus-error",
    "cd/focus/best-gains",
    "cd/focus/circle-cover",
    "cd/focus/closed-loop",
    "cd/focus/controller",
    "cd/focus/false-detections",
    "cd/focus/immunity",
    "cd/focus/start-up",
    "cd/optics",
    "cd/playability-full",
    "cd/radial-error",
    "cd/radial/after-defects",
    "cd/radial/ageing",
    "cd/radial/bandwidth-trade-off",
    "cd/radial/controller-change",
    "cd/radial/controllers",
    "cd/radial/cover-variants",
    "cd/radial/diode-plane",
    "cd/radial/disturbance-groups",
    "cd/radial/exact-residuals",
    "cd/radial/experiment-settings",
    "cd/radial/gain-control",
    "cd/radial/gain-ramp",
    "cd/radial/gain-room",
    "cd/radial/identified",
    "cd/radial/linearity",
    "cd/radial/loop-models",
    "cd/radial/lower-bandwidth",
    "cd/radial/measured-sensitivity",
    "cd/radial/mu-pid",
    "cd/radial/multisine-linearity",
    "cd/radial/nominal",
    "cd/radial/nyquist",
    "cd/radial/observer-bandwidth",
    "cd/radial/open-loop",
    "cd/radial/optical-gain",
    "cd/radial/parametric",
    "cd/radial/position-estimator",
    "cd/radial/recovery",
    "cd/radial/residual-index",
    "cd/radial/response-methods",
    "cd/radial/sensitivity",
    "cd/radial/stadium-cover",
    "cd/radial/state-feedback",
    "cd/radial/strategies",
    "cd/radial/track-jump",
    "cd/radial/two-controllers",
    "cd/radial/two-controllers-switched",
    "cd/radial/uncertainty-comparison",
    "cd/radial/unlike-arms",
    "cd/radial/wrong-rotation",
    "cd/raised-sum",
    "cd/red-book",
    "cd/sledge",
    "cd/sums",
    "cd/diodes",
    "cd/diode-map",
    "compare",
    "mass-spring/analysis",
    "textbook/estimate-regions",
    "textbook/experiment-times",
    "textbook/real-mu-jump",
    "textbook/record-lengths",
    "unstable-first-order/reduction",
    "unstable-first-order/board",
]
"""Of the other kinds those whose certificate takes less than 0.3 s, then those of more."""
HEAVY = [
    "cd-arm/identification",
    "cd/claims",
    "cd/focus/fault-filter",
    "cd/focus/methods",
    "cd/radial/cover-for-control",
    "cd/radial/designed-filter",
    "cd/radial/excursion",
    "cd/radial/five-x",
    "cd/radial/integrated-design",
    "cd/radial/mu-pid-analysis",
    "cd/radial/printed-filter",
    "cd/radial/smallest-area-stadiums",
    "cd/radial/switching-stability",
    "cd/two-axes",
    "mass-spring/demands",
    "textbook/box/estimate-to-mu",
]


@functools.lru_cache(maxsize=1)
def stored(problem):
    """Task, answer's dataset, tolerance and claim of the run that is soonest checked."""

    def seconds(folder):
        return json.loads((folder / "run.json").read_text())["seconds"]["check"]

    run = Run(min(finished_folders(REFERENCE / problem), key=seconds))
    data = run.data.load()
    # as `verify` does: other processors compute others
    task = rebuilt(run, registry()).task.of_stored(data)
    optimal = isinstance(task, Program) and find_method(task, run.method).optimal
    return task, data, float(run.info["options"]["tolerance"]), optimal


def flips(problem, seeds):
    """What fails of the certificates of the run with its data, then its answer, changed."""
    task, data, tolerance, optimal = stored(problem)
    for seed in seeds:
        for asked, told in ((shaken(task, seed), data), (task, shaken(data, seed))):
            if asked is task and told is data:  # a study of settings has no data
                continue
            found = asked.certify(asked.from_dataset(told), tolerance, optimal=optimal)
            if not found.holds:
                return seed, "data" if told is data else "answer", found.failures
    return None


def many(problems, count):
    return [
        pytest.param(name, range(count), id=f"{name}-{count}", marks=pytest.mark.slow)
        for name in problems
    ]


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("problem", "seeds"),
    [
        *(pytest.param(name, range(20), id=name) for name in FAST),
        *many([*FAST, *OTHERS], 200),
        *many(HEAVY, 20),
    ],
)
def test_no_verdict_flips_where_last_bits_change(problem, seeds):
    assert flips(problem, seeds) is None


@pytest.mark.slow
def test_every_stored_kind_is_tried():
    tried = {type(stored(name)[0]) for name in [*FAST, *OTHERS, *HEAVY]}
    assert {type(wb.open_run(folder).task) for folder in finished_folders(REFERENCE)} <= tried


def test_a_claim_without_room_is_refuted():
    """The test can fail: bounds of mu that are what one processor proves, and no more."""
    task, data, _, _ = stored("quick/distillation/mu-upper")
    answer = task.from_dataset(data)
    bare = certified_bound(task.M, task.structure, answer.D_left, answer.D_right, answer.G)
    bare = replace(answer, value=bare)
    assert task.certify(bare, 1e-6).holds
    failed = [not shaken(task, seed).certify(bare, 1e-6).holds for seed in range(20)]
    assert np.mean(failed) > 0.5
