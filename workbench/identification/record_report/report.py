"""The report of a record: every test, and every finding."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from workbench.errors import InputError
from workbench.identification.record_report.feedback import feedback
from workbench.identification.record_report.finding import Finding, Tested
from workbench.identification.record_report.record import Record

TESTS: tuple[Callable[[Record], Tested], ...] = (feedback,)
"""Each test takes a record and says what became of one assumption."""


@dataclass(frozen=True)
class RecordReport:
    """What was tested of a record, and what was found.

    Parameters
    ----------
    tested
        Each assumption and what its test gave.
    """

    tested: tuple[Tested, ...]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was found, what forbids the use of the record first."""
        found = [finding for one in self.tested for finding in one.findings]
        return tuple(sorted(found, key=lambda finding: not finding.forbids))

    @property
    def usable(self) -> bool:
        """Whether no finding forbids to estimate anything from the record."""
        return not any(finding.forbids for finding in self.findings)

    def need_usable(self, name: str = "the record") -> None:
        """Raise `InputError` with what forbids the use of the record, if anything does."""
        if not self.usable:
            forbidding = [str(finding) for finding in self.findings if finding.forbids]
            raise InputError(f"{name}: {'; '.join(forbidding)}")

    @property
    def assumptions(self) -> str:
        """All assumptions with what their tests gave, in one line, for a certificate."""
        return "; ".join(map(str, self.tested))

    def __repr__(self) -> str:
        count = len(self.findings)
        head = f"RecordReport: {len(self.tested)} assumptions, {count or 'no'} findings"
        return "\n".join([head, *(f"  {finding}" for finding in self.findings)])


def reported(record: Record) -> RecordReport:
    """The report of a record."""
    return RecordReport(tuple(test(record) for test in TESTS))
