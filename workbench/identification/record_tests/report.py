"""The report of a record: all tests and findings, and assumptions that the user vouches for."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from workbench.errors import InputError, UnknownNameError
from workbench.identification.record_tests.clipping import clipping
from workbench.identification.record_tests.collinear import independent_inputs
from workbench.identification.record_tests.delay import prompt_outputs
from workbench.identification.record_tests.excitation import excitation
from workbench.identification.record_tests.finding import Finding, TestedAssumption
from workbench.identification.record_tests.flags import flags
from workbench.identification.record_tests.gaps import complete_outputs, instants
from workbench.identification.record_tests.loop.feedback import open_loop
from workbench.identification.record_tests.nonlinearity import nonlinearity
from workbench.identification.record_tests.quantisation import quantisation
from workbench.identification.record_tests.record import RecordData
from workbench.identification.record_tests.slow import drift, long_record
from workbench.identification.record_tests.spikes import spikes
from workbench.identification.record_tests.stuck import stuck
from workbench.input_checks import as_list

TESTS: tuple[Callable[[RecordData], TestedAssumption], ...] = (
    open_loop,
    flags,
    excitation,
    independent_inputs,
    spikes,
    clipping,
    stuck,
    quantisation,
    complete_outputs,
    instants,
    drift,
    long_record,
    prompt_outputs,
    nonlinearity,
)
"""Each test takes a record and returns the state of one assumption."""
REMEMBERED = 32
"""Number of reports that are cached, since several estimators often use one record."""
_KNOWN: dict[Hashable, RecordReport] = {}


@dataclass(frozen=True, repr=False)
class RecordReport:
    """Tests of a record, and their findings.

    Parameters
    ----------
    tested
        Each assumption with the result of its test.
    settled
        Assumptions, by name, that need no test, with the reason: the user vouches for them, or the
        estimate does not depend on them.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import record_report
    >>> u = np.random.default_rng(0).standard_normal(500)
    >>> report = record_report(u, np.convolve(u, [0.5, 0.3])[:500])
    >>> report.usable
    True
    """

    tested: tuple[TestedAssumption, ...]
    reasons: Mapping[str, str] = field(default_factory=dict, kw_only=True)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings; those that forbid the use of the record come first."""
        found = [finding for one in self.tested for finding in one.findings]
        return tuple(sorted(found, key=lambda finding: not finding.forbids))

    @property
    def usable(self) -> bool:
        """Whether no finding forbids estimates.

        Findings against assumptions with a reason do not count.
        """
        return not self._forbidding

    @property
    def _forbidding(self) -> list[tuple[TestedAssumption, Finding]]:
        """Findings that forbid the use of the record, each with the assumption it contradicts."""
        return [
            (one, finding)
            for one in self.tested
            if one.assumption not in self.reasons
            for finding in one.findings
            if finding.forbids
        ]

    def assuming(self, assumptions: str | Sequence[str]) -> RecordReport:
        """The report when the user also vouches for these assumptions.

        Raises `UnknownNameError` for a name that belongs to no test.
        """
        return self.with_reasons(dict.fromkeys(as_names(assumptions), "assumed by the user"))

    def with_reasons(self, reasons: Mapping[str, str]) -> RecordReport:
        """The report in which these assumptions, by name, need no test for the given reasons."""
        known = [one.assumption for one in self.tested]
        for name in reasons:
            if name not in known:
                raise UnknownNameError("assumption", name, known)
        return replace(self, reasons={**self.reasons, **reasons})

    def need_usable(self, name: str = "the record") -> None:
        """Raise `InputError` with the findings that forbid the use of the record, if any."""
        if not self.usable:
            against = ", ".join(dict.fromkeys(repr(one.assumption) for one, _ in self._forbidding))
            told = "; ".join(str(finding) for _, finding in self._forbidding)
            raise InputError(
                f"{name}: {told}. Who knows better says assume=[{against}] (--assume NAME)"
            )

    @property
    def sentences(self) -> tuple[str, ...]:
        """Each assumption with the result of its test, for certificates."""
        return tuple(self._sentence(one) for one in self.tested)

    def _sentence(self, one: TestedAssumption) -> str:
        why = self.reasons.get(one.assumption)
        if why is None:
            return str(one)
        against = "; ".join(finding.message for finding in one.findings if finding.forbids)
        if against:
            return f"{one.assumption}: {why}, against the finding: {against}"
        how = "tested" if one.testable else "not testable"
        return f"{one.assumption}: {why}; {how}; {one.result}"

    def __repr__(self) -> str:
        untested = [one.assumption for one in self.tested if not one.testable]
        head = f"RecordReport: {len(self.tested) - len(untested)} assumptions tested"
        lines = [head if self.findings else f"{head}, nothing found"]
        lines += [f"  {'forbids  ' if one.forbids else ''}{one}" for one in self.findings]
        return "\n".join([*lines, *(f"  not testable: {name}" for name in untested)])


def together(reports: Mapping[str, RecordReport]) -> tuple[str, ...]:
    """Each assumption with its results for several records; equal results are stated once."""
    names: dict[str, list[str]] = {}
    for name, report in reports.items():
        for sentence in report.sentences:
            names.setdefault(sentence, []).append(name)
    return tuple(
        sentence if len(of) == len(reports) else f"{', '.join(of)}: {sentence}"
        for sentence, of in sorted(names.items(), key=lambda pair: pair[0].partition(":")[0])
    )


def as_names(assumptions: str | Sequence[str]) -> tuple[str, ...]:
    """Names of assumptions, one or several, as a tuple; raises `InputError` for others."""
    given = [assumptions] if isinstance(assumptions, str) else as_list(assumptions, "assume")
    if not all(isinstance(name, str) for name in given):
        raise InputError(f"assume is {assumptions!r}; names of assumptions are needed")
    return tuple(given)


def reported(record: RecordData) -> RecordReport:
    """The report of a record; recent reports are cached."""
    key = (TESTS, record.key())
    found = _KNOWN.get(key)
    if found is None:
        found = _KNOWN[key] = RecordReport(tuple(test(record) for test in TESTS))
        for old in list(_KNOWN)[:-REMEMBERED]:
            _KNOWN.pop(old, None)
    return found
