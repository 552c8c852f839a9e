"""The answer of mu synthesis: a controller with proven bounds on the peak of mu."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field

from workbench._core.heavy_types import StateSpace
from workbench.mu import Peak
from workbench.synthesis.h_infinity.figures import DrawnController
from workbench.synthesis.mu.rounds import Iterate
from workbench.systems.realisation import in_words


@dataclass(frozen=True, eq=False, repr=False)
class MuController(DrawnController):
    """A controller u = K y with positive feedback, and certified bounds on the peak of mixed mu.

    Unlike a `StateSpace`, it has proven bounds on the mu of its loop.

    The supremum of mixed mu over frequency lies in [``lower``, ``upper``]; ``omega`` [rad/s] is the
    frequency of the lower bound. ``history`` holds the rounds of the iteration. ``peak`` holds the
    multipliers or scalings and the perturbation that prove the bounds.

    Examples
    --------
    >>> import control
    >>> import workbench as wb
    >>> from workbench.structure import Complex
    >>> from workbench.synthesis import MuSynthesis
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> parts = [
    ...     (G, "v", "y"),
    ...     (control.ss([], [], [], [[0.2]]), "u", "z"),
    ...     (control.tf([0.4], [1.0, 0.01]), "e", "z_e"),
    ... ]
    >>> sums = {"v": "u + d", "e": "r - y"}
    >>> uncertain = [(Complex(1), "z", "d")]
    >>> plant = generalised_plant(
    ...     parts,
    ...     sums,
    ...     perturbation=uncertain,
    ...     exogenous=["r"],
    ...     performance=["z_e"],
    ...     control=["u"],
    ...     measurement="e",
    ... )
    >>> K = control.ss([[-0.01]], [[1.0]], [[1.0]], [[1.0]])
    >>> answer = wb.solve(MuSynthesis(plant, target=0.9), method="dk").answer
    >>> bool(answer.lower <= answer.upper < 0.9), answer.K.noutputs
    (True, 1)
    """

    K: StateSpace
    lower: float
    upper: float
    omega: float
    _: KW_ONLY
    history: tuple[Iterate, ...] = field(default=())
    peak: Peak | None = None
    whole: StateSpace | None = field(default=None, kw_only=True)
    """The controller of the user's plant if K is only a part of it; otherwise None."""

    @property
    def lti(self) -> StateSpace:
        """The controller of the user's plant."""
        return self.whole or self.K

    def summary(self) -> str:
        return (
            f"MuController: {in_words(self.lti)}\n"
            f"  peak of mu from {self.lower:.4g} to {self.upper:.4g}, about {self.omega:.4g} rad/s"
        )

    @classmethod
    def of(cls, controller: StateSpace, found: Peak, history: tuple[Iterate, ...]) -> MuController:
        """The answer for a controller and the peak of its loop."""
        return cls(controller, found.lower, found.upper, found.omega, history=history, peak=found)
