"""Test whether the loop is open: whether the inputs come from outside or from the outputs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.identification.record_tests.finding import Finding, TestedAssumption
from workbench.identification.record_tests.loop.feedback_findings import (
    closed_loop,
    of_excitation,
    static,
)
from workbench.identification.record_tests.loop.granger import Prediction, input_predictions
from workbench.identification.record_tests.loop.memories import FEWEST_SAMPLES, Memory, memory
from workbench.identification.record_tests.loop.shares import largest_share
from workbench.identification.record_tests.loop.statics import static_input
from workbench.identification.record_tests.periods import (
    between_periods,
    common_period,
    period,
    without_periodic_part,
)
from workbench.identification.record_tests.record import RecordData

CHANCE, TINY_CHANCE = 5e-4, 1e-6
"""Probability of a false alarm for a record, and the probability below which there is no doubt."""
LEAST_EXPLAINED, TINY_EXPLAINED = 0.02, 0.002
"""Least shares of an input's surprise that the outputs must predict in other parts of the record,
at each of these probabilities. A plant that a few hundred lags do not describe causes tiny shares
without feedback.
"""
MOSTLY_EXPLAINED, EXPLAINED_ALONE = 0.5, 0.8
"""Share of the surprise above which its colour does not matter, and share above which the
probability does not: with a few large surprises the probability cannot be small, even if the
outputs predict each of them.
"""
BESIDE_STEPS = 0.25
"""A share of the small surprises that the outputs predict, but not of the large ones, indicates
feedback with set-point changes.
"""
REPEATED = 1e-6
"""Range of the differences between periods, relative to an input's deviation, that counts as
rounding.
"""
SAYS_NOTHING = 0.5
"""If the bound on the share of an input that may come from the outputs exceeds this, nothing is
known.
"""
Periods = list[list[int | None]]
"""Period [samples] of each input in each experiment."""


UNDISTURBED = 1e-6
"""If the deviation of the outputs' new part, relative to their size, is below this, nothing
disturbs them.
"""
HARMLESS_EXPLAINED, HARMLESS_SHARE = 0.01, 0.05
"""Harmless shares of an input that the outputs predict: of its surprise, and of its variance."""


@dataclass(frozen=True)
class Verdict:
    """The verdict on one input: why nothing is known, or the largest share, or a finding."""

    share: float = 0.0
    untestable: str = ""
    finding: Finding | None = None
    repeats: bool = False


def open_loop(record: RecordData) -> TestedAssumption:
    """Test whether the inputs come from outside; or, with an excitation, whether that does.

    An input that repeats exactly, up to rounding, contains no noise of the outputs. If it repeats
    nearly, the differences between its periods are tested instead. The test asks whether the past
    of the outputs predicts the input better than its own past alone (module `granger`); if `direct`
    is False, y of the same sample counts as past.

    The reported share is an upper bound, at 95 % confidence, on the part of an input's variance
    that linear feedback makes of the outputs' new part, if the feedback forgets within an eighth of
    the shortest experiment, and within 4,096 samples. If `direct` is True, an input's dependence on
    the output of the very same sample is not included: it cannot be distinguished from the plant's
    response.

    On simulated loops with noise the bound holds in 99 of 100; in 83 of 100 if the disturbance is a
    few steps of load, which carry too little information.

    With an excitation r the loop may be closed: then r is tested, and must not depend on y.

    Parameters
    ----------
    record
        A record.

    Returns
    -------
    Tested
        The result. It may have the finding "feedback", which forbids the use of the record, or
        "static", which does not: an input is an exact function of the outputs at the same sample,
        so the plant is static, or the apparent plant is -1/K for a static controller K.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification.record_tests.loop.feedback import feedback
    >>> from workbench.identification.record_tests.record import RecordData
    >>> rng = np.random.default_rng(0)
    >>> u, v = rng.standard_normal((2, 1000, 1))
    >>> y = 0.5 * np.roll(u, 1) + 0.1 * v
    >>> print(feedback(RecordData(u, y, None, (0,), 1.0, ("u",), ("y",))))
    open loop: tested; at most 5 % of the variance of 'u' can come from the outputs

    References
    ----------
    C. W. J. Granger, Investigating causal relations by econometric models and cross-spectral
    methods, Econometrica 37 (1969). P. E. Caines, C. W. Chan, Feedback between stationary
    stochastic processes, IEEE Trans. Automatic Control 20 (1975). L. Ljung, System Identification,
    2nd ed. (1999), sections 13.4 and 16.6.
    """
    if record.r is not None:
        names = tuple(f"excitation {i + 1}" for i in range(record.r.shape[1]))
        record = replace(record, u=record.r, inputs=names)
        assumption = "excitation from outside"
    else:
        assumption = "open loop"
    moving = [i for i, u in enumerate(record.u.T) if np.ptp(u) > 0]
    seen = [
        j for j, y in enumerate(record.y.T) if np.isfinite(y).any() and np.nanmin(y) < np.nanmax(y)
    ]
    if not moving or not seen:
        what = "output" if moving else "input"
        return TestedAssumption(assumption, f"no {what} ever changes", testable=False)
    record = replace(
        record,
        u=_scaled(record.u[:, moving]),
        y=_scaled(record.y[:, seen]),
        inputs=tuple(record.inputs[i] for i in moving),
        outputs=tuple(record.outputs[j] for j in seen),
    )
    verdicts = _verdicts(record)
    if record.r is not None:
        verdicts = [
            one if one.finding is None else replace(one, finding=of_excitation(one.finding))
            for one in verdicts
        ]
    return _summed_up(assumption, record.inputs, verdicts)


def _scaled(signal: RealArray) -> RealArray:
    """A signal (N, channels) with zero mean and size 1: no square overflows or underflows."""
    signal = signal / np.nanmax(np.abs(signal), axis=0)
    signal = signal - np.nanmean(signal, axis=0)
    return signal / np.nanmax(np.abs(signal), axis=0)


def _verdicts(record: RecordData) -> list[Verdict]:
    """The verdict on each input."""
    known: dict[int, Verdict] = {}
    periods = [[period(u) for u in record.u[piece].T] for piece in record.pieces()]
    for i, repeats in enumerate(_repeated(record, periods)):
        if repeats:
            known[i] = Verdict(repeats=True)
        elif static_input(record, i):
            known[i] = Verdict(finding=static(record.inputs[i], record.direct))
    if len(known) < len(record.inputs):
        inner = _between_periods(record, periods)
        part = inner.u.std(axis=0) / record.u.std(axis=0)
        rest = memory(inner)
        for i in set(range(len(record.inputs))) - set(known):
            known[i] = _verdict(rest, i, record.inputs[i], float(part[i]))
    return [known[i] for i in sorted(known)]


def _between_periods(record: RecordData, periods: Periods) -> RecordData:
    """Differences between the periods of a record with periodic inputs, or the record itself."""
    inputs, outputs, starts = [], [], [0]
    for piece, own in zip(record.pieces(), periods, strict=True):
        samples = common_period(record.u[piece], own)
        u = None if samples is None else between_periods(record.u[piece], samples)
        if samples is None or u is None:
            return record
        inputs.append(u)
        outputs.append(without_periodic_part(record.y[piece][-len(u) :], samples))
        starts.append(starts[-1] + len(u))
    u, y = np.concatenate(inputs), np.concatenate(outputs)
    return replace(record, u=u, y=y, starts=tuple(starts[:-1]))


def _repeated(record: RecordData, periods: Periods) -> list[bool]:
    """Mask of the inputs that repeat up to rounding, in each experiment."""
    alike = np.ones(record.u.shape[1], bool)
    for piece, own in zip(record.pieces(), periods, strict=True):
        for i, (u, samples) in enumerate(zip(record.u[piece].T, own, strict=True)):
            apart = np.inf if samples is None else np.ptp(u[samples:] - u[:-samples])
            alike[i] &= bool(apart <= REPEATED * u.std())
    return alike.tolist()


def _verdict(rest: Memory | None, column: int, name: str, part: float) -> Verdict:
    """Verdict on an input, by the past of the outputs; a `part` of its deviation is tested."""
    if rest is None:
        many = "and more for many channels"
        why = f"at least {FEWEST_SAMPLES} samples without a break are needed, {many}"
        return Verdict(untestable=why)
    if rest.u[:, column].std() == 0.0:
        return Verdict(untestable=f"'{name}' changes at the begin of the record alone")
    share = part**2 * largest_share(rest.u[:, column], rest.new, rest.first_lag, rest.longest_lag)
    alike, weighted = input_predictions(rest, column)
    explained = _explained(alike, weighted, CHANCE / rest.u.shape[1])
    if rest.new.std(axis=0).max() < UNDISTURBED:
        explained = None  # outputs that the inputs alone cause feed nothing back
    if explained is not None and (explained > HARMLESS_EXPLAINED or share > HARMLESS_SHARE):
        return Verdict(finding=closed_loop(name, explained, share))
    if alike.doubt and weighted.doubt:
        return Verdict(untestable=f"'{name}' {alike.doubt}")
    if share > SAYS_NOTHING:
        why = f"up to {share:.0%} of the variance of '{name}' may come from the outputs"
        return Verdict(untestable=why)
    return Verdict(share)


def _explained(alike: Prediction, weighted: Prediction, chance: float) -> float | None:
    """Share of an input's surprise that the outputs predict, if only feedback explains it."""
    for found in (alike, weighted):
        least = TINY_EXPLAINED if found.chance < TINY_CHANCE else LEAST_EXPLAINED
        significant = found.chance < chance and not found.noisy
        clear = not found.doubt and not found.clocked and found.explained > least
        told = significant and (clear or found.explained > MOSTLY_EXPLAINED)
        if not found.rounding and (told or found.explained > EXPLAINED_ALONE):
            return found.explained
    small = weighted.explained > max(BESIDE_STEPS, 2.0 * alike.explained)
    doubtful = weighted.rounding or weighted.swept or weighted.chance_without_noise >= chance
    return weighted.explained if small and not doubtful else None


def _summed_up(
    assumption: str, names: tuple[str, ...], verdicts: list[Verdict]
) -> TestedAssumption:
    """One statement about all inputs."""
    findings = tuple(one.finding for one in verdicts if one.finding is not None)
    said = [finding.message for finding in findings]
    said += dict.fromkeys(one.untestable for one in verdicts if one.untestable)
    known = [
        (name, one)
        for name, one in zip(names, verdicts, strict=True)
        if one.finding is None and not one.untestable
    ]
    said += [f"'{name}' repeats to rounding: open" for name, one in known if one.repeats]
    shares = {name: one.share for name, one in known if not one.repeats}
    if shares:
        most = np.ceil(100 * max(shares.values()))
        which = (
            "any input"
            if len(shares) == len(names) > 1
            else " or ".join(f"'{name}'" for name in shares)
        )
        said.append(f"at most {most:.0f} % of the variance of {which} can come from the outputs")
    testable = bool(findings) or not any(one.untestable for one in verdicts)
    return TestedAssumption(assumption, "; ".join(said), testable=testable, findings=findings)
