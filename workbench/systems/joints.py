"""Conversion of anything that stands for a linear system; arrays and numbers are gains."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import is_real
from workbench.structure import Structure


class UncertainPart(ABC):
    """A system with its perturbation pulled out; it can be a block of a connection."""

    @property
    @abstractmethod
    def structure(self) -> Structure:
        """Blocks of the perturbation."""

    @property
    @abstractmethod
    def system(self) -> StateSpace:
        """System with named inputs (perturbation, inputs) and outputs (perturbation, outputs)."""

    @property
    @abstractmethod
    def lti(self) -> Any:
        """The nominal system, without the perturbation."""

    @property
    def tested(self) -> tuple[str, ...]:
        """The tests of the records from which it was identified, for certificates."""
        return ()

    @property
    def known_by_name(self) -> tuple[str, ...]:
        """Names of perturbations that mean the same perturbation wherever they occur."""
        return ()


def part_of(given: Any, name: str) -> Any:
    """The StateSpace, TransferFunction or `UncertainPart` that an object stands for.

    A number or an array (outputs, inputs) is a gain, with any sampling time. An answer, a Solution,
    a Run, or any other object with an attribute ``lti`` stands for that system. `name` is its name
    in messages.

    Raises
    ------
    InputError
        The object stands for none of these, is not finite, or is a Solution or a Run without a
        certified answer.
    """
    import control

    kinds = (control.StateSpace, control.TransferFunction, UncertainPart)
    part = given
    while not isinstance(part, kinds):
        if is_real(part) or isinstance(part, np.ndarray | list):
            return _gain(part, name)
        if isinstance(part, type) or not hasattr(part, "lti"):
            raise InputError(
                f"{name} must be a StateSpace, a TransferFunction, a gain, an uncertain model or a "
                f"Solution with one of these, not {type(part).__name__}{type_hint(part)}"
            )
        part = part.lti
    return part


def system_of(given: Any, name: str) -> Any:
    """The StateSpace or TransferFunction that an object stands for: of a model, the nominal.

    Raises as `part_of`.
    """
    part = part_of(given, name)
    while isinstance(part, UncertainPart):
        part = part_of(part.lti, name)
    return part


def _gain(value: Any, name: str) -> StateSpace:
    """A number or an array (outputs, inputs) as a system without states."""
    import control

    try:
        if np.asarray(value).dtype.kind not in "iuf":
            raise TypeError
        gain = np.atleast_2d(np.asarray(value, dtype=float))
    except (TypeError, ValueError):
        raise InputError(f"{name} is {value!r}; a gain needs real numbers in rows alike") from None
    if gain.ndim != 2 or not gain.size:
        raise InputError(
            f"{name} is an array of shape {np.shape(value)}; a gain needs finite numbers of shape "
            "(outputs, inputs)"
        )
    if not np.isfinite(gain).all():
        raise InputError(f"{name} is {value!r}; a gain needs finite numbers")
    return control.StateSpace([], [], [], gain, None)


def type_hint(part: Any) -> str:
    """Advice for other types of objects that people pass."""
    if hasattr(part, "frdata") or type(part).__name__ == "Responses":
        return (
            "; a measured response has no poles: fit a model or a cover to it first; of its own it "
            "has margins, by `loop_margins`, and mu at its frequencies, by `upper_bound`"
        )
    if hasattr(part, "to_ss"):
        time = ", s.dt" if part.dt is not None else ""
        return (
            "; of a system of scipy.signal take s = system.to_ss() and "
            f"control.ss(s.A, s.B, s.C, s.D{time})"
        )
    if isinstance(part, type):
        return f"; {part.__name__} is a class, give one of its objects"
    if hasattr(part, "checks"):
        return f"; a {type(part).__name__} is a question: solve it first, wb.solve(...)"
    return ""
