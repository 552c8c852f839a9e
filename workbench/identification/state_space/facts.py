"""Facts about a state-space fit that its certificate states in addition to its checks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import RealArray
from workbench.identification.innovations.distortion import Distortion, distortion_of
from workbench.identification.innovations.impulse_responses import (
    has_finite_response,
    impulse_response_changes,
)
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.uncertainty import (
    magnitude_deviations,
    model_deviations,
    of_magnitudes,
    static_gain,
)
from workbench.identification.innovations.whiteness import Whiteness, model_whiteness
from workbench.identification.state_space.identified import MODELS, IdentifiedModels
from workbench.identification.state_space.question import RecordedQuestion

MOST_STATES_OF_DEVIATIONS = 24
"""Most states of a model for which standard deviations are computed: the cost grows with their
cube.
"""
LINEAR = (
    "standard deviations take the plant as linear: they do not count its distortion, and are too "
    "small where it has some; regions of Responses.from_files count it if the excitation repeats"
)
"""What deviations assume where errors are not tested for distortion."""
COUNTED = (
    "deviations count this; they are about the best linear model for such an excitation, and "
    "another one may have another"
)
"""What deviations count where errors show distortion."""
UNSEEN = "the errors show no distortion, and deviations count none"
"""What deviations assume where the test for distortion finds none."""
ENDLESS = (
    "its impulse responses have not died out where they end, so deviations are infinite; "
    "take a longer record, larger steps of time, or another method"
)
"""What is said of impulse responses that are too short."""
POLE_GIVEN = 1e-6
"""A model's pole within this distance of a known pole counts as that pole."""


def facts_of(
    program: RecordedQuestion, answer: IdentifiedModels, tasks: Sequence[str]
) -> list[str]:
    """Sentences about the record and about the choice of the models.

    ``tasks`` are the purposes for which predictor and simulator are chosen.
    """
    record, words = program.record, list(program.report.sentences)
    if len(record.starts) > 1:
        words.append(f"{len(record.starts)} experiments, each with an initial state of its own")
    if record.missing:
        words.append(f"{record.missing} of {record.y.size} output samples are missing")
    if program.delays_samples:
        found = ", ".join(map(str, program.delays_samples))
        how = "estimated" if isinstance(program.delay_samples, str) else "given"
        words.append(f"inputs act {found} samples later, as {how}")
    if program.known is not None and program.known.poles:
        poles = ", ".join(
            f"{p.real:.6g}{p.imag:+.6g}j" if p.imag else f"{p.real:.6g}"
            for p in program.known.poles
        )
        words.append(f"poles {poles} are given, not estimated")
    if program.known is not None and program.known.gain is not None:
        count = int(np.isfinite(program.known.gain).sum())
        words.append(f"{count} static gains are given, not estimated")
    if len(program.estimation_record) > program.estimation_samples:
        words.append(
            "no input moves in the estimation part: what inputs do rests on the assumption "
            "that they stepped from zero, at rest, at the first sample"
        )
    if not program.folds:
        words.append("orders chosen by the final prediction error: no part could be held back")
    if answer.candidates is not None:
        words += [answer.candidates.words(use, task) for use, task in enumerate(tasks)]
    return words


def deviations_told(program: RecordedQuestion, answer: IdentifiedModels) -> list[str]:
    """Sentences on how well the record determines both models, and on what is not counted."""
    words = []
    for name in MODELS:
        model = getattr(answer, name)
        beyond = None
        if is_tested(model):
            beyond = distortion_of(model, program.estimation_record, program.direct, program.known)
        words += [distortion_told(beyond, name), *_uncertainty(program, model, name)]
        white = not_white(program, model, name)
        if white:
            words.append(f"{white}: deviations do not count what plant or noise have beyond it")
    return words


def distortion_told(beyond: Distortion | None, name: str) -> str:
    """A sentence on distortion, which deviations count if the errors show it; None: not tested."""
    if beyond is None:
        return f"{name}: {LINEAR}"
    return f"{name}: {beyond.words}; {COUNTED}" if beyond.found else f"{name}: {UNSEEN}"


def is_tested(model: InnovationsModel) -> bool:
    """Whether tests of one-step errors are made for a model."""
    endless = model.members or has_finite_response(model)
    return not endless and model.order <= MOST_STATES_OF_DEVIATIONS


def whiteness_of(program: RecordedQuestion, model: InnovationsModel) -> Whiteness | None:
    """The test of a model's one-step errors; None for models that it is not made for."""
    if not is_tested(model):
        return None
    return model_whiteness(model, program.estimation_record, program.direct)


def not_white(program: RecordedQuestion, model: InnovationsModel, name: str) -> str:
    """A sentence on one-step errors that are not white; empty if they are, or are not tested."""
    found = whiteness_of(program, model)
    if found is None or found.holds:
        return ""
    return f"{name}: one-step errors are not white, {found.words}"


def simulator_deviations(
    program: RecordedQuestion, answer: IdentifiedModels, frequency: RealArray
) -> RealArray | None:
    """Standard deviations (F, ny, nu) of the simulator's magnitudes, if its errors are white.

    None for an average of models, and for a model with many states. ``frequency`` [cycles/sample].
    """
    model = answer.simulator
    if model.members:
        return None
    if has_finite_response(model):
        return _of_impulses(program, frequency, model.response(frequency))
    if model.order > MOST_STATES_OF_DEVIATIONS:
        return None
    return magnitude_deviations(
        model, program.estimation_record, frequency, program.direct, program.known
    )


def _of_impulses(program: RecordedQuestion, frequency: ArrayLike, response: ArrayLike) -> RealArray:
    """Deviations (F, ny, nu) of magnitudes of impulse responses; infinite if these do not end."""
    changes, ended = impulse_response_changes(
        program.estimation_record, frequency, direct=program.direct, delay=program.delays_samples
    )
    found = of_magnitudes(changes, np.asarray(response))
    return found if ended else np.full(found.shape, np.inf)


def _uncertainty(program: RecordedQuestion, model: InnovationsModel, name: str) -> list[str]:
    """A sentence on how well the record determines a model's slowest pole and static gains."""
    if model.members:
        return [f"{name}: no standard deviations of an average of models are computed"]
    if has_finite_response(model):
        gains = static_gain(model)
        deviations = _of_impulses(program, [0.0], gains)[0]
        words = [_gain_told(program, name, gains, deviations)]
        return words if np.isfinite(deviations).all() else [*words, f"{name}: {ENDLESS}"]
    if model.order > MOST_STATES_OF_DEVIATIONS:
        return [f"{name}: no standard deviations of {model.order} states are computed"]
    found, words = (
        model_deviations(model, program.estimation_record, program.direct, program.known),
        [],
    )
    if len(found.poles):
        slowest = int(np.argmax(np.abs(found.poles)))
        size, deviation = abs(found.poles[slowest]), found.pole_deviations[slowest]
        given = program.known.poles if program.known else ()
        told = "" if abs(size - 1) > 2 * deviation else "; it may lie on the unit circle"
        if any(np.isclose(found.poles[slowest], pole, rtol=0, atol=POLE_GIVEN) for pole in given):
            told = ", as given"
        words.append(f"{name}: slowest pole of modulus {size:.6g} +- {deviation:.2g}{told}")
    return [*words, _gain_told(program, name, found.gains, found.gain_deviations)]


def _gain_told(
    program: RecordedQuestion, name: str, gains: RealArray, deviations: RealArray
) -> str:
    """A sentence on the least certain static gain."""
    worst = np.unravel_index(int(np.argmax(deviations)), gains.shape)
    return (
        f"{name}: static gain from {program.record.inputs[int(worst[1])]} to "
        f"{program.record.outputs[int(worst[0])]} {gains[worst]:.6g} +- {deviations[worst]:.2g}"
    )
