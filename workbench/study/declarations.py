"""Declarations of a Study: stored dimensions, arrays and systems, and intermediate results.

A declaration is an attribute of a Study's class. Its function takes what it needs by name, as
pytest fixtures do: other declarations, ``self`` for the Study's own fields, ``context`` for the
run's. Arrays and dimensions arrive as labelled `xarray.DataArray`.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from workbench._core.heavy_types import Dataset
from workbench.errors import InputError
from workbench.systems.storage import restored_system, stored_system

Function = Callable[..., Any]


class Declaration:
    """A named function of a Study and of the things that its arguments name."""

    def __init__(self, function: Function | None) -> None:
        self.function = function
        self.name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the arguments, without ``self``."""
        if self.function is None:
            return ()
        return tuple(name for name in inspect.signature(self.function).parameters if name != "self")

    @property
    def help(self) -> str:
        """The first line of the docstring, without its full stop."""
        text = inspect.getdoc(self.function) if self.function is not None else None
        return (text or "").partition("\n")[0].removesuffix(".")

    def value(self, study: Any, get: Callable[[str], Any]) -> Any:
        """The function's result; the arguments are looked up by name."""
        assert self.function is not None
        given = {name: get(name) for name in self.needs}
        if "self" in inspect.signature(self.function).parameters:
            given["self"] = study
        return self.function(**given)


class PartDeclaration(Declaration):
    """An intermediate result: computed once for everything that needs it, and not stored."""


def part(function: Function) -> Any:
    """Declare an intermediate result of any type: computed once, not stored.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> from workbench import Study, solve
    >>> from workbench.study import array, dim, part
    >>> @dataclass(frozen=True)
    ... class Squares(Study):
    ...     '''Squares of some numbers by a table.'''
    ...
    ...     number = dim(1, 2, 3)
    ...
    ...     @part
    ...     def table(self):
    ...         return {1: 1, 2: 4, 3: 9}
    ...
    ...     square = array(
    ...         dims=number, unit="1", meaning="square", value=lambda table: [table[k] for k in (1,
    ...         2, 3)]
    ...     )
    ...
    >>> sorted(solve(Squares()).answer.data_vars)
    ['square']
    """
    return PartDeclaration(function)


class Dim(Declaration):
    """A dimension with its coordinates."""

    def __init__(
        self, function: Function | None, labels: Sequence[Any] | None, unit: str, meaning: str
    ) -> None:
        super().__init__(function)
        self.labels, self.unit, self.meaning = labels, unit, meaning

    def variable(self, study: Any, get: Callable[[str], Any]) -> tuple[Any, ...]:
        """Name, labels and attributes of the dimension, for a dataset."""
        labels = self.labels if self.function is None else self.value(study, get)
        meaning = self.meaning or self.help
        about = {"units": self.unit} if self.unit else {}
        about |= {"long_name": meaning} if meaning else {}
        return self.name, np.asarray(labels), about


def dim(*labels: Any, unit: str = "", meaning: str = "") -> Any:
    """Declare a dimension by its labels, or as a decorator of a function that returns them.

    Examples
    --------
    ``bound = dim("lower", "upper")``, or ``@dim(unit="Hz")`` above a function that returns
    frequencies (F,).

    >>> from dataclasses import dataclass
    >>> from workbench import Study, solve
    >>> from workbench.study import array, dim
    >>> @dataclass(frozen=True)
    ... class Lines(Study):
    ...     '''A line of frequencies.'''
    ...
    ...     count: int = 3
    ...
    ...     @dim(unit="Hz")
    ...     def frequency(self):
    ...         return [100.0 * (k + 1) for k in range(self.count)]
    ...
    ...     twice = array(
    ...         dims=frequency, unit="Hz", meaning="twice", value=lambda frequency: 2 * frequency
    ...     )
    ...
    >>> solve(Lines()).answer["twice"].values.tolist()
    [200.0, 400.0, 600.0]
    """
    if labels:
        every = labels[0] if len(labels) == 1 and not isinstance(labels[0], str) else labels
        if callable(every):
            return Dim(every, None, unit, meaning)
        return Dim(None, list(every), unit, meaning)
    return lambda function: Dim(function, None, unit, meaning)


class ArrayDeclaration(Declaration):
    """Arrays that are stored, over declared dimensions; several arrays if ``units`` names them."""

    def __init__(
        self,
        function: Function,
        dims: Sequence[Any],
        units: str | Mapping[str, Any],
        meaning: str,
        coordinate: bool,
        extra: Mapping[str, Any],
    ) -> None:
        super().__init__(function)
        self._dims, self.units, self.meaning = dims, units, meaning
        self.coordinate, self.extra = coordinate, dict(extra)

    @property
    def dims(self) -> tuple[str, ...]:
        return tuple(one.name if isinstance(one, Declaration) else str(one) for one in self._dims)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its arrays."""
        return (self.name,) if isinstance(self.units, str) else tuple(self.units)

    def variables(
        self, study: Any, get: Callable[[str], Any], sizes: Mapping[str, Sequence[Any]]
    ) -> dict[str, tuple[Any, ...]]:
        """Dataset variables by name; empty if the function returns None."""
        value = self.value(study, get)
        if value is None:
            return {}
        if isinstance(self.units, str):
            return {
                self.name: self._variable(
                    self.name, value, self.units, self.meaning or self.help, sizes
                )
            }
        return {
            name: self._variable(name, value[name], *_unit_and_meaning(about), sizes)
            for name, about in self.units.items()
            if value.get(name) is not None
        }

    def _variable(
        self, name: str, value: Any, unit: str, meaning: str, sizes: Mapping[str, Sequence[Any]]
    ) -> tuple[Any, ...]:
        dims = self.dims
        if hasattr(value, "dims"):
            value = value.transpose(*dims).values
        elif isinstance(value, Mapping) and dims:
            value = [value[label] for label in sizes[dims[0]]]
        values = np.asarray(value)
        shape = tuple(len(sizes[one]) for one in dims if one in sizes)
        if values.ndim != len(dims) or (len(shape) == len(dims) and values.shape != shape):
            raise InputError(
                f"array {name!r} has shape {values.shape}; its dims "
                f"({', '.join(dims)}) have sizes {shape}"
            )
        about = {"units": unit} if unit else {}
        about |= {"long_name": meaning} if meaning else {}
        return dims, values, about | self.extra


Dims = Any  # a dimension, as an object or by its name, or a tuple of them


def array(
    *,
    dims: Dims = (),
    unit: str = "",
    meaning: str = "",
    value: Function | None = None,
    coordinate: bool = False,
    **attributes: Any,
) -> Any:
    """Declare an array over dimensions.

    Parameters
    ----------
    dims
        A dimension declared before, or its name, or a tuple of these.
    unit, meaning
        Stored as ``units`` and ``long_name``. The default meaning is the docstring.
    value
        The function; if it is left out, this is a decorator. It returns anything of the shape of
        the dimensions, or a mapping from the labels of the first one; None if this Study has no
        such array.
    coordinate
        Whether the array is stored as a coordinate beside the labels of its dimension.
    attributes
        Stored as attributes of the array.

    Examples
    --------
    ``gain = array((drive, quantity), "1", "optical gain", lambda scans: [s.gain for s in scans])``

    >>> from dataclasses import dataclass
    >>> from workbench import Study, solve
    >>> from workbench.study import array, dim
    >>> @dataclass(frozen=True)
    ... class Squares(Study):
    ...     '''Squares of some numbers.'''
    ...
    ...     number = dim(1, 2, 3)
    ...
    ...     @array(dims=number, unit="m2")
    ...     def square(self, number):
    ...         '''Area of a square.'''
    ...         return number**2
    ...
    >>> solve(Squares()).answer["square"].values.tolist()
    [1, 4, 9]
    """
    over = dims if isinstance(dims, tuple) else (dims,)
    if value is not None:
        return ArrayDeclaration(value, over, unit, meaning, coordinate, attributes)
    return lambda function: ArrayDeclaration(function, over, unit, meaning, coordinate, attributes)


def arrays(dims: Dims = (), value: Function | None = None, /, **units: Any) -> Any:
    """Declare several arrays over the same dimensions; the function returns them by name.

    ``arrays((loop, drive), lambda found: found, crossover=("Hz", "crossover"), phase="deg")`` gives
    each array its unit, or its unit and meaning. Without a function this is a decorator.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> from workbench import Study, solve
    >>> from workbench.study import arrays, dim
    >>> @dataclass(frozen=True)
    ... class Powers(Study):
    ...     '''Powers of some numbers.'''
    ...
    ...     number = dim(1, 2, 3)
    ...
    ...     @arrays(number, square="1", cube=("1", "third power"))
    ...     def powers(self, number):
    ...         return {"square": number**2, "cube": number**3}
    ...
    >>> solve(Powers()).answer["cube"].values.tolist()
    [1, 8, 27]
    """
    over = dims if isinstance(dims, tuple) else (dims,)
    if value is not None:
        return ArrayDeclaration(value, over, units, "", False, {})
    return lambda function: ArrayDeclaration(function, over, units, "", False, {})


def _unit_and_meaning(about: str | tuple[str, str]) -> tuple[str, str]:
    return (about, "") if isinstance(about, str) else about


class VariablesDeclaration(Declaration):
    """Arrays whose names and dimensions are chosen by the function."""


def variables(function: Function) -> Any:
    """Declare stored arrays whose names and dimensions the function chooses, as those of a proof.

    The function returns dataset variables by name: dimensions, values and attributes.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> import numpy as np
    >>> from workbench import Study, solve
    >>> from workbench.study import variables
    >>> @dataclass(frozen=True)
    ... class Proof(Study):
    ...     '''Multipliers of a proof.'''
    ...
    ...     @variables
    ...     def multipliers(self):
    ...         return {"D": (("row", "column"), np.eye(2), {"units": "1"})}
    ...
    >>> solve(Proof()).answer["D"].shape
    (2, 2)
    """
    return VariablesDeclaration(function)


class System(Declaration):
    """Stored python-control systems: one, or one for each label of a dimension.

    Called with a Study and its dataset, it returns them.
    """

    def __init__(self, function: Function, over: Any, called: str) -> None:
        super().__init__(function)
        self._over, self.called = over, called

    @property
    def over(self) -> str | None:
        return self._over.name if isinstance(self._over, Declaration) else self._over

    def prefix(self, label: Any) -> str:
        """First part of the names of one system's arrays."""
        if self.over is None:
            return self.called or self.name
        return (self.called or f"{self.name}_{{}}").format(identifier(label))

    def variables(self, value: Any, labels: Sequence[Any]) -> dict[str, Any]:
        """Dataset variables for the systems that the function returned."""
        if value is None:
            return {}
        if self.over is None:
            return stored_system(self.prefix(None), value)
        every = value if isinstance(value, Mapping) else dict(zip(labels, value, strict=True))
        return {
            key: one
            for label in labels
            if every.get(label) is not None
            for key, one in stored_system(self.prefix(label), every[label]).items()
        }

    def restored(self, data: Dataset) -> Any:
        """The system, or the systems by label; systems that are not stored are left out."""
        if self.over is None:
            return (
                restored_system(data, self.prefix(None))
                if f"{self.prefix(None)}_A" in data
                else None
            )
        return {
            label: restored_system(data, self.prefix(label))
            for label in data[self.over].values.tolist()
            if f"{self.prefix(label)}_A" in data
        }

    def __get__(self, study: Any, owner: type) -> Any:
        return self if study is None else self.restored


def system(over: Any = None, *, called: str = "") -> Any:
    """Declare a stored system (or one for each label of the dimension ``over``).

    ``study.name(dataset)`` returns it: a StateSpace, or a mapping from labels. ``called`` is the
    first part of its arrays' names, with ``{}`` for the label.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> import control
    >>> from workbench import Study, solve
    >>> from workbench.study import system
    >>> @dataclass(frozen=True)
    ... class Loop(Study):
    ...     '''A controller.'''
    ...
    ...     @system
    ...     def controller(self):
    ...         return control.ss([[-2.0]], [[1.0]], [[3.0]], [[0.0]])
    ...
    >>> study = Loop()
    >>> study.controller(solve(study).answer).poles().tolist()
    [(-2+0j)]
    """
    if inspect.isfunction(over):
        return System(over, None, "")
    return lambda function: System(function, over, called)


def identifier(label: Any) -> str:
    """A label as used in names of arrays and metrics: lower case, words joined by ``_``.

    Examples
    --------
    >>> from workbench.study import identifier
    >>> identifier("Robust performance, D-K")
    'robust_performance_d_k'
    """
    text = str(label).lower()
    return "_".join("".join(one if one.isalnum() else " " for one in text).split())
