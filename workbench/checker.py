"""What checks an answer from the data alone."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from workbench.certificate import Certificate, Check, Gap, quantified
from workbench.heavy_types import Figure


class Checker(ABC):
    """The data of a question, and what checks an answer from them: `certify` issues a certificate.

    Every Program and every Study is one. So is what a function leaves with its `Answer`.
    """

    @property
    def quantifier(self) -> str:
        """What the checks quantify over that do not say it themselves: frequencies, plants, data.

        Such as "at the 400 given frequencies, for these 12 plants".
        """
        return ""

    @abstractmethod
    def checks(self, answer: Any, tolerance: float) -> Sequence[Check]:
        """Validity checks of an answer from the data alone, decided by the kernel."""

    def witnessed(self, answer: Any) -> Any:
        """The answer with what its second opinion looks at, found once and stored.

        `solve` asks for it, so that `verify` searches nothing.
        """
        return answer

    def second_opinion(self, answer: Any) -> Sequence[Check]:
        """Checks that share neither code nor mathematics with `checks`, of a valid answer.

        They try the same claims in another way, and fail only if something is wrong.
        """
        return ()

    def gap(self, answer: Any) -> tuple[str, float] | None:
        """Relative optimality gap by an independent bound, and what it says; None without one."""
        return None

    def facts(self, answer: Any) -> Sequence[str]:
        """What the certificate of a valid answer tells besides, such as a controller's order."""
        return ()

    def figures(self, answer: Any) -> dict[str, Figure]:
        """Figures by file stem; returned, never written."""
        return {}

    def certify(self, answer: Any, tolerance: float, *, optimal: bool = False) -> Certificate:
        """Certificate of an answer; ``optimal`` when whoever gave it claims it is the best."""
        with np.errstate(all="ignore"):  # a wrong answer may make NaN of a check, which fails it
            checks = tuple(quantified(self.quantifier, self.checks(answer, tolerance)))
            facts: tuple[str, ...] = ()
            if all(check.holds for check in checks):
                opinion = quantified(self.quantifier, self.second_opinion(answer))
                checks += tuple(replace(check, opinion=True) for check in opinion)
                facts = tuple(self.facts(answer))
            gap = self.gap(answer)
        return Certificate(checks, gap and Gap(gap[0], gap[1], tolerance, required=optimal), facts)
