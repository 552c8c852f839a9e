"""Claims that a conic program has no solution, or no least value, and their proofs."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from flint import fmpq

from workbench._core.heavy_types import Dataset
from workbench.certificate import Certificate, Check
from workbench.certify.cones.form import ConicForm
from workbench.certify.cones.membership import Rational, outside
from workbench.certify.cones.rays import conic_slack, dot, excluded_radius
from workbench.conic.ray_search import dual_ray, falling_ray, feasible_point, settled_ray
from workbench.errors import InputError
from workbench.executor import Context
from workbench.program import Claim, Program, ProofTask, Task
from workbench.second_opinion import conic_proofs
from workbench.solvers import Outcome

Vectors = dict[str, list[Rational]]
"""Rational vectors by name, which prove a claim."""


class ConicallyStated(Program):
    """A Program that is a conic program, so that the absence of a solution can be proven.

    Examples
    --------
    >>> from workbench.conic import ConicallyStated, ConicProgram
    >>> issubclass(ConicProgram, ConicallyStated)
    True
    """

    @abstractmethod
    def conic_form(self) -> ConicForm:
        """Its data in standard form."""

    def claim_task(self, claim: Outcome) -> Task | None:
        tasks = {Outcome.INFEASIBLE: NoSolution, Outcome.UNBOUNDED: NoLeastValue}
        return tasks[claim](self.conic_form()) if claim in tasks else None


@dataclass(frozen=True, eq=False)
class _ConicClaim(ProofTask):
    """A claim about a conic form, proven by rational vectors."""

    form: ConicForm
    lengths: ClassVar[dict[str, str]] = {}
    """Names of the vectors, and whether each has one entry per row or per column of the form."""

    @property
    def quantifier(self) -> str:
        return "for the doubles of the conic form, taken as exact"

    def to_dataset(self, answer: Vectors) -> Dataset:
        import xarray as xr

        return xr.Dataset(
            {
                name: (self.lengths[name], [str(value) for value in values], {"units": "1"})
                for name, values in answer.items()
            }
        )

    def from_dataset(self, data: Dataset) -> Vectors:
        sizes = {"row": self.form.b.size, "column": self.form.c.size}
        found = {}
        for name, along in self.lengths.items():
            if data[name].dims != (along,) or data[name].size != sizes[along]:
                raise InputError(f"{name} must have {sizes[along]} entries along {along}")
            found[name] = [parsed_rational(str(text)) for text in data[name].values]
        return found


class NoSolution(_ConicClaim):
    """The claim that no x has b - A x in K.

    A ray y of the dual cone with b'y < 0 proves it if A'y = 0. Otherwise the ray proves that no
    solution has max |x| < R (`workbench.certify.cones.rays`). R is the metric ``radius``.

    Examples
    --------
    >>> import workbench as wb
    >>> from workbench.conic import ConeFactor, ConeKind, ConicForm, ConicProgram
    >>> cones = (ConeFactor(ConeKind.NONNEGATIVE, 2),)
    >>> form = ConicForm([1.0], [[-1.0], [1.0]], [-2.0, 1.0], cones)  # x >= 2 and x <= 1
    >>> program = ConicProgram(form)
    >>> solution = wb.solve(program, method="clarabel")
    >>> print(solution.outcome, solution.certificate.holds)
    infeasible True
    """

    headline = "radius"
    lengths: ClassVar[dict[str, str]] = {"y": "row"}

    def respond(self, method: str | None, context: Context) -> Claim:
        y = dual_ray(self.form, context)
        if y is None:
            return None, Outcome.FAILED, "no ray of the dual cone speaks against a solution"
        radius = excluded_radius(self.form, y)
        if radius == math.inf:
            return {"y": y}, Outcome.SOLVED, "an exact ray of the dual cone excludes every solution"
        said = f"all that is proven: no solution has max |x| < R = {radius:.6g}"
        return {"y": y}, Outcome.INACCURATE, said

    def checks(self, answer: Vectors, tolerance: float) -> Sequence[Check]:
        y, meaning = answer["y"], "1 if b'y is 0 or more, 0 if it is negative, decided exactly"
        return [
            Check(
                "dual cone",
                "cones whose dual does not hold y, decided exactly",
                outside(self.form, y, dual=True),
                0.0,
                proven=True,
            ),
            Check("separation", meaning, float(dot(self.form.b, y) >= 0), 0.0, proven=True),
        ]

    def second_opinion(self, answer: Vectors) -> Sequence[Check]:
        y = self.ray(answer)
        radius = excluded_radius(self.form, y)
        return [conic_proofs.supports(self.form, y), conic_proofs.separates(self.form, y, radius)]

    def gap(self, answer: Vectors) -> tuple[str, float]:
        radius = excluded_radius(self.form, self.ray(answer))
        statement = "1 / R, where no solution has max |x| < R = -b'y / sum |A'y|, decided exactly"
        return statement, 1.0 / radius if radius else math.inf

    def certify(self, answer: Any, tolerance: float, *, optimal: bool = False) -> Certificate:
        """Valid if y excludes solutions up to some R; it holds if y excludes all of them."""
        return super().certify(answer, 0.0, optimal=True)

    def metrics(self, answer: Vectors) -> dict[str, float]:
        return {"radius": excluded_radius(self.form, self.ray(answer))}

    def ray(self, answer: Vectors) -> Sequence[Rational]:
        """The vector y of the answer that is judged."""
        return answer["y"]


class NoSolutionOfComputed(NoSolution):
    """As `NoSolution`, for a form that a Program computes, which may differ between processors.

    The last bits of its doubles differ, so that A'y = 0 holds only up to a residual; y is moved
    until the residual is 0.
    """

    def ray(self, answer: Vectors) -> Sequence[Rational]:
        return settled_ray(self.form, answer["y"])


class NoLeastValue(_ConicClaim):
    """The claim that c'x has no lower limit: a solution x, and a ray d along which c'x decreases.

    Examples
    --------
    >>> import workbench as wb
    >>> from workbench.conic import ConeFactor, ConeKind, ConicForm, ConicProgram
    >>> cones = (ConeFactor(ConeKind.NONNEGATIVE, 2),)
    >>> form = ConicForm([-1.0], [[-1.0], [0.0]], [0.0, 1.0], cones)  # the largest x >= 0
    >>> program = ConicProgram(form)
    >>> solution = wb.solve(program, method="clarabel")
    >>> print(solution.outcome, solution.certificate.holds)
    unbounded True
    """

    headline = "falling"
    lengths: ClassVar[dict[str, str]] = {"x": "column", "ray": "column"}

    def respond(self, method: str | None, context: Context) -> Claim:
        ray = falling_ray(self.form, context)
        if ray is None:
            return None, Outcome.FAILED, "no ray was found along which the objective falls"
        x = feasible_point(self.form, context)
        if x is None:
            said = "the objective falls along a ray, but no solution was found from which it starts"
            return None, Outcome.FAILED, said
        said = "from an exact solution the objective falls for ever along an exact ray"
        return {"x": x, "ray": ray}, Outcome.SOLVED, said

    def checks(self, answer: Vectors, tolerance: float) -> Sequence[Check]:
        form, x, ray = self.form, answer["x"], answer["ray"]
        return [
            Check(
                "solution",
                "cones that do not hold their part of b - A x, decided exactly",
                outside(form, conic_slack(form, x)),
                0.0,
                proven=True,
            ),
            Check(
                "ray",
                "cones that do not hold their part of -A d, decided exactly",
                outside(form, conic_slack(form, ray, of_ray=True)),
                0.0,
                proven=True,
            ),
            Check(
                "falling",
                "1 if c'd of the ray is 0 or more, 0 if it is negative, decided exactly",
                float(dot(form.c, ray) >= 0),
                0.0,
                proven=True,
            ),
        ]

    def second_opinion(self, answer: Vectors) -> Sequence[Check]:
        return [conic_proofs.falls(self.form, answer["x"], answer["ray"])]

    def metrics(self, answer: Vectors) -> dict[str, float]:
        return {"falling": float(dot(self.form.c, answer["ray"]) < 0)}


def parsed_rational(text: str) -> Rational:
    """A rational number from its text by `str`; raises InputError for any other text."""
    try:
        return fmpq(text)
    except (TypeError, ValueError, ZeroDivisionError):
        raise InputError(f"{text[:40]!r} is no rational number") from None
