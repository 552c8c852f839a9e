"""A fitted function as a python-control system that keeps its certificate."""

from __future__ import annotations

from typing import Any

import control

from workbench.answer import Answer, ProgramAnswer
from workbench.certificate import OriginalAnswerChecker
from workbench.fitting.rational import Rational


class FittedSystem(ProgramAnswer, control.StateSpace):
    """A StateSpace with the certificate of its fit. Systems computed from it are plain StateSpace
    objects.

    Unlike a plain `StateSpace`, it is an answer with checks.

    ``value`` is the worst error of the fit.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.fitting import fit_response
    >>> omega = np.geomspace(0.1, 10, 30)
    >>> G = fit_response(omega, 3 / (1j * omega + 2), order=1)
    >>> G.holds, bool(G.value < 1e-6), type(2 * G).__name__
    (True, True, 'StateSpace')
    """

    __repr__ = control.StateSpace.__repr__
    plot = Answer.plot

    @classmethod
    def of(cls, fit: Rational) -> FittedSystem:
        """The realisation of a fit, with the checker of the fit."""
        system: Any = cls(fit.state_space())
        if fit._checked_by is not None:
            checker, tolerance, optimal = fit._checked_by
            made = vars(fit).get("certificate")
            as_fit = OriginalAnswerChecker(checker, fit)
            system.with_checker(as_fit, gap_tolerance=tolerance, optimal=optimal, certificate=made)
        return system
