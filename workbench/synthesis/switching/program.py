"""Dwell times that make sampled switched linear systems stable.

    x[k + 1] = A_i x[k]    in mode i, from any mode to any other.

Each mode has a quadratic function V_i = x' P_i x of the state at its entry. If for every allowed
stay n and every mode j that may follow

    (A_i^n)' P_j A_i^n < P_i,

then V falls from entry to entry and the system is stable. In a mode without a longest stay, the
inequality for the shortest n and A_i' P_i A_i < P_i imply it for all longer stays (J. C. Geromel,
P. Colaneri, Stability and stabilization of discrete time switched systems, Int. J. Control 79
(2006) 719-728).

Powers of A are computed for each plant on its own. If the A are the vertices of a set and the
whole set is meant, a rate r < 1 keeps the inequalities linear in A:

    A_i' P_i A_i < r^2 P_i,    r^(2 n - 2) A_i' P_j A_i < P_i.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Dataset, Figure
from workbench.answer import ProgramAnswer
from workbench.certificate import Check
from workbench.certify.quadratic_forms import QuadraticForm, ball_product, ball_quotient, power
from workbench.errors import InputError
from workbench.input_checks import as_list
from workbench.program import Program
from workbench.second_opinion.exact_switchings import exact_products
from workbench.second_opinion.switchings import fastest_growth
from workbench.synthesis.switching.modes import Mode, check_modes, is_whole
from workbench.synthesis.switching.periodic import longest_unstable

FALL_MARGIN = 1e-9
"""Least relative decrease of V, which is proven by ball arithmetic."""


@dataclass(frozen=True, eq=False, repr=False)
class Dwell(ProgramAnswer):
    """Shortest stay ``samples`` of the sought modes, and the matrices ``P`` (modes, n, n) that
    prove it.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.synthesis import Mode, SwitchedStability
    >>> clean, defect = np.array([[0.5, 1.0], [0.0, 0.5]]), np.array([[0.5, 0.0], [1.0, 0.5]])
    >>> program = SwitchedStability(
    ...     (Mode("clean", clean, shortest_samples=None), Mode("defect", defect))
    ... )
    >>> dwell = wb.solve(program, method="clarabel").answer
    >>> dwell.P.shape
    (2, 2, 2)
    """

    samples: int
    P: RealArray


@dataclass(frozen=True, eq=False)
class SwitchedStability(Program):
    """The shortest stay in the sought modes for which any switching is stable.

    The same matrices P prove stability for all plants. The result is an upper bound: shorter stays
    may be stable too. ``destabilising`` is a lower bound: some periodic switching makes it
    unstable.

    Parameters
    ----------
    modes
        Two or more modes with the same plants and states; at least one has ``shortest`` None.
    limit_samples
        Longest dwell time that is tried [samples].

    Raises
    ------
    InputError
        There is only one mode; no mode has a sought stay; modes differ in plants or states; the
        limit is not positive; a mode without a longest stay is unstable; or the rate of a mode is
        not above the spectral radius of each plant.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.synthesis import Mode, SwitchedStability
    >>> clean, defect = np.array([[0.5, 1.0], [0.0, 0.5]]), np.array([[0.5, 0.0], [1.0, 0.5]])
    >>> program = SwitchedStability(
    ...     (Mode("clean", clean, shortest_samples=None), Mode("defect", defect))
    ... )
    >>> solution = wb.solve(program, method="clarabel")
    >>> solution.certificate.valid, solution.answer.samples >= 1
    (True, True)
    """

    modes: tuple[Mode, ...]
    _: KW_ONLY
    limit_samples: int = 100_000

    default_method: ClassVar[str] = "clarabel"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.synthesis.switching.conic",
        "workbench.synthesis.switching.descent",
    )
    headline: ClassVar[str] = "dwell"

    def __post_init__(self) -> None:
        object.__setattr__(self, "modes", tuple(as_list(self.modes, "modes")))
        check_modes(self.modes)
        if not any(mode.shortest_samples is None for mode in self.modes):
            raise InputError("no mode has shortest None: say whose dwell time is sought")
        if not (is_whole(self.limit_samples) and self.limit_samples > 0):
            raise InputError(
                f"limit_samples is {self.limit_samples!r}; it must be a positive number of samples"
            )
        for mode in self.modes:
            worst = int(np.argmax(mode.radius))
            if mode.longest_samples is None and mode.radius[worst] >= 1.0:
                raise InputError(
                    f"mode {mode.name!r} has no longest stay and is unstable: its spectral radius "
                    f"is {mode.radius[worst]:.9g} for plant {worst}; give the longest stay"
                )
            if mode.rate is not None and mode.radius[worst] >= mode.rate:
                raise InputError(
                    f"mode {mode.name!r}: rate is {mode.rate}; it must be above the spectral "
                    f"radius, {mode.radius[worst]:.9g} for plant {worst}"
                )

    @property
    def quantifier(self) -> str:
        plants = len(self.modes[0].A)
        among = "this one plant" if plants == 1 else f"these {plants} plants"
        return f"for {among}, in these {len(self.modes)} modes"

    @property
    def states(self) -> int:
        """Number of states."""
        return int(self.modes[0].A.shape[-1])

    def stays(self, mode: Mode, samples: int) -> range:
        """Stays of a mode that have an inequality of their own, if the sought dwell time is
        ``samples``.
        """
        shortest = samples if mode.shortest_samples is None else mode.shortest_samples
        return range(shortest, (mode.longest_samples or shortest) + 1)

    def ratios(self, answer: Dwell, i: int) -> tuple[RealArray, float]:
        """Bounds on V at the next entry over V_i (stays,), and on V_i after a sample over V_i
        before it.

        The second is 0 for a mode with a longest stay, where V_i need not fall in every sample.
        """
        mode, forms = self.modes[i], [QuadraticForm(P) for P in answer.P]
        others = [form for j, form in enumerate(forms) if j != i]
        stays = self.stays(mode, answer.samples)
        found, decay = np.zeros(len(stays)), 0.0
        for A in mode.A:
            over = power(A, stays[0], mode.rate)
            for k in range(len(stays)):
                found[k] = max(found[k], *(forms[i].ratio(other, over) for other in others))
                over = ball_product(A, over)
            if not mode.longest_samples:
                decay = max(decay, forms[i].ratio(forms[i], ball_quotient(A, mode.rate or 1.0)))
        return found, decay

    @cached_property
    def destabilising(self) -> tuple[int, str]:
        """Longest dwell time [samples] found with an unstable periodic switching, and a text.

        The text describes the switching. The dwell time is 0 where none was found.
        """
        best, which = 0, ""
        for i, one in enumerate(self.modes):
            for other in self.modes[i + 1 :]:
                if one.shortest_samples is None or other.shortest_samples is None:
                    pair = (one, other) if one.shortest_samples is None else (other, one)
                    found, stay = longest_unstable(*pair, self.limit_samples)
                    if found > best:
                        best = found
                        which = f"{found} samples in {pair[0].name}, {stay} in {pair[1].name}"
        return best, which

    # --- objective ----------------------------------------------------------------------------

    @property
    def problem_size(self) -> float:
        """Number of free entries of the symmetric P of all modes together."""
        return len(self.modes) * self.states * (self.states + 1) / 2

    def objective(self, answer: Dwell) -> float:
        """The dwell time [samples]."""
        return float(answer.samples)

    def objective_scale(self, answer: Dwell) -> float:
        """The shortest dwell time [samples] that is not excluded by an unstable periodic
        switching.
        """
        return float(self.destabilising[0] + 1)

    # --- checks -------------------------------------------------------------------------------

    def checks(self, answer: Dwell, tolerance: float) -> list[Check]:
        n, count = self.states, len(self.modes)
        fits = answer.P.shape == (count, n, n) and bool(np.isfinite(answer.P).all())
        fits = fits and 0 < answer.samples <= self.limit_samples
        statement = "whether P has another shape, or the dwell time is none"
        found = [Check("dimensions", statement, float(not fits), 0.0)]
        if not fits:
            return found
        skew = max(float(np.abs(P - P.T).max() / np.abs(P).max()) for P in answer.P)
        found.append(Check("symmetry", "largest P - P', relative", skew, 1e-12))
        unproven = sum(not QuadraticForm(P).positive for P in answer.P)
        statement = "number of P that are not proven to be positive definite"
        found.append(Check("positive", statement, float(unproven), 0.0, proven=True))
        if unproven:
            return found
        for i, mode in enumerate(self.modes):
            at_entry, decay = self.ratios(answer, i)
            stays = self.stays(mode, answer.samples)
            worst = int(np.argmax(at_entry))
            statement = "largest V of the next mode at its entry over V of this at its own"
            where = f"after {stays[worst]} samples"
            limit = 1.0 - FALL_MARGIN
            name = f"{mode.name}, entries"
            over = f"for every state, after each stay of {stays[0]} to {stays[-1]} samples"
            found.append(
                Check(
                    name,
                    statement,
                    float(at_entry[worst]),
                    limit,
                    where=where,
                    over=over,
                    proven=True,
                )
            )
            if mode.longest_samples is None:
                of = "" if mode.rate is None else " and rate^2"
                statement = f"largest V of this mode after a sample over V before{of}"
                decays = Check(f"{mode.name}, decay", statement, decay, limit, proven=True)
                found.append(replace(decays, over="for every state"))
        return found

    def second_opinion(self, answer: Dwell) -> list[Check]:
        rate, which = fastest_growth(*self._allowed(answer))
        statement = "logarithmic growth in one period of switchings drawn, less its rounding"
        over = "for periodic switchings drawn"
        return [Check("switchings drawn", statement, rate, 0.0, where=which, over=over)]

    def deep_opinion(self, answer: Dwell) -> list[Check]:
        return [*super().deep_opinion(answer), *exact_products(*self._allowed(answer))]

    def _allowed(self, answer: Dwell) -> tuple[list[RealArray], list[int], list[int | None]]:
        """Transition matrices of the modes, and the shortest and the longest stay in each."""
        shortest = [
            answer.samples if m.shortest_samples is None else m.shortest_samples for m in self.modes
        ]
        return [m.A for m in self.modes], shortest, [m.longest_samples for m in self.modes]

    def gap(self, answer: Dwell) -> tuple[str, float]:
        found, which = self.destabilising
        statement = "dwell time over the shortest that no periodic switching found excludes, less 1"
        return f"{statement} ({which})" if which else statement, answer.samples / (found + 1) - 1

    def metrics(self, answer: Dwell) -> dict[str, float]:
        return {
            "dwell": float(answer.samples),
            "destabilising": float(self.destabilising[0]),
            "states": float(self.states),
            "plants": float(len(self.modes[0].A)),
        }

    # --- datasets and figures -----------------------------------------------------------------

    def to_dataset(self, answer: Dwell) -> Dataset:
        import xarray as xr

        about = {"long_name": "V = x' P x at the entry of each mode"}
        transition = {"long_name": "transition over a sample"}
        return xr.Dataset(
            {
                "A": (
                    ("mode", "plant", "state", "state_"),
                    np.stack([mode.A for mode in self.modes]),
                    transition,
                ),
                "P": (("mode", "state", "state_"), answer.P, about),
                "dwell": ((), answer.samples, {"units": "1", "long_name": "shortest stay"}),
            },
            coords={"mode": [mode.name for mode in self.modes]},
        )

    def from_dataset(self, data: Dataset) -> Dwell:
        return Dwell(int(data["dwell"]), data["P"].values)

    def figures(self, answer: Dwell) -> dict[str, Figure]:
        figure, (panel,) = figures.axes(1, 1)
        for i, mode in enumerate(self.modes):
            ratio, _ = self.ratios(answer, i)
            panel.semilogy(
                self.stays(mode, answer.samples), ratio, ".-" if len(ratio) > 1 else "D",
                label=mode.name,
            )  # fmt: skip
        panel.axhline(1.0, color="0.4", linewidth=0.8)
        panel.locator_params(axis="x", integer=True, min_n_ticks=1)
        figures.label(panel, x="stay [samples]", y="V at the next entry over V at this [1]")
        figures.legend_below(figure, panel)
        return {"entries": figure}
