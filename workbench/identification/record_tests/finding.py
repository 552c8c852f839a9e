"""Results of a test of a record: a finding, and the state of the tested assumption."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Finding:
    """A property of a record that harms estimates from it.

    Parameters
    ----------
    kind
        A word or two: "feedback", "spikes", "clipped".
    message
        What was found, in a sentence without a full stop.
    where
        Channel and samples, such as "output 'speed', samples 17 and 230".
    strength
        The size of the effect, as a number.
    measure
        Meaning of that number, such as "share of the input's variance that comes from the output".
    remedy
        What to do.
    forbids
        Whether nothing may be estimated from the record as it is.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import record_report
    >>> u = np.random.default_rng(0).standard_normal(500)
    >>> y = np.convolve(u, [0.5, 0.3])[:500]
    >>> y[[100, 300]] = -9999.0
    >>> finding = record_report(u, y).findings[0]
    >>> finding.kind, finding.forbids
    ('flags', True)
    """

    kind: str
    message: str
    where: str
    strength: float
    measure: str
    remedy: str
    forbids: bool = field(default=False, kw_only=True)

    def __str__(self) -> str:
        return f"{self.kind}: {self.message} ({self.where}): {self.remedy}"


@dataclass(frozen=True)
class TestedAssumption:
    """An assumption about a record, and the result of its test.

    Parameters
    ----------
    assumption
        What is assumed, such as "open loop".
    result
        The result, such as "at most 4 % of the variance of 'u' can come from 'y'", or the reason
        why it cannot be tested.
    testable
        Whether the record allows the test.
    findings
        Findings that contradict the assumption.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import record_report
    >>> u = np.random.default_rng(0).standard_normal(500)
    >>> tested = record_report(u, np.convolve(u, [0.5, 0.3])[:500]).tested[0]
    >>> tested.assumption, tested.testable
    ('open loop', True)
    """

    assumption: str
    result: str
    testable: bool = field(default=True, kw_only=True)
    findings: tuple[Finding, ...] = field(default=(), kw_only=True)

    def __str__(self) -> str:
        return f"{self.assumption}: {'tested' if self.testable else 'not testable'}; {self.result}"
