"""Metrics, tables and figures of a Study, declared over its stored arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import product
from typing import Any

from workbench import figures
from workbench._core.heavy_types import Figure
from workbench._core.tables import markdown_table
from workbench.study.declarations import Declaration, Function, identifier

Get = Callable[[str], Any]


class Metric(Declaration):
    """A number that people quote, or one for each label of an array's dimensions."""

    def __init__(self, function: Function, template: str) -> None:
        super().__init__(function)
        self.template = template

    def metrics(self, study: Any, get: Get) -> dict[str, float]:
        value = self.value(study, get)
        if value is None:
            return {}
        if isinstance(value, Mapping):
            return {name: float(one) for name, one in value.items()}
        if not getattr(value, "dims", ()):
            return {self.template or self.name: float(value)}
        template = self.template or "_".join([self.name, *(f"{{{name}}}" for name in value.dims)])
        names = [value[name].values.tolist() for name in value.dims]
        return {
            template.format(**dict(zip(value.dims, map(_named, labels), strict=True))): float(
                value.sel(dict(zip(value.dims, labels, strict=True)))
            )
            for labels in product(*names)
        }


def _named(label: Any) -> str:
    """A label as used in the name of a metric."""
    text = str(label)
    return text if text.isidentifier() or text.isalnum() else identifier(text)


def metric(template: Function | str = "", *, value: Function | None = None) -> Any:
    """Declare a metric: a function of stored arrays that returns a number.

    An array gives one metric for each label, named by a template, as in
    ``metric("error_{quantity}", lambda error: abs(error).max("drive"))``. A mapping gives one
    metric for each of its names; None gives no metric. Without a function this is a decorator.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> from workbench import Study, solve
    >>> from workbench.study import array, dim, metric
    >>> @dataclass(frozen=True)
    ... class Squares(Study):
    ...     '''Squares of some numbers.'''
    ...
    ...     number = dim(1, 2, 3)
    ...     square = array(dims=number, unit="1", meaning="square", value=lambda number: number**2)
    ...     most = metric(lambda square: square.max())
    ...
    >>> solve(Squares()).metrics
    {'most': 9.0}
    """
    if not isinstance(template, str):
        return Metric(template, "")
    if value is not None:
        return Metric(value, template)
    return lambda function: Metric(function, template)


class Table(Declaration):
    """A table in Markdown, or several by name."""

    def tables(self, study: Any, get: Get) -> dict[str, str]:
        value = self.value(study, get)
        every = value if isinstance(value, Mapping) else {stem(self.name): value}
        return {
            name: one if isinstance(one, str) else markdown_table(*one)
            for name, one in every.items()
            if one is not None
        }


def table(function: Function | None = None, *, rows: Any = None, **columns: Any) -> Any:
    """Declare a table: a function that returns heads and rows, or a column for each array.

    A function may also return a text, or a mapping from names to tables; None gives no table.

    ``table(rows="drive", gain="{:.0f}", error="{:+.2%}")`` has a row for each drive and a column
    for each array over drives; a second dimension makes a column for each of its labels.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> from workbench import Study, solve
    >>> from workbench.study import array, dim, table
    >>> @dataclass(frozen=True)
    ... class Squares(Study):
    ...     '''Squares of some numbers.'''
    ...
    ...     number = dim(1, 2, 3)
    ...     square = array(dims=number, unit="1", meaning="square", value=lambda number: number**2)
    ...     squares = table(rows=number, square="{:.0f}")
    ...
    >>> study = Squares()
    >>> list(study.tables(solve(study).answer))
    ['squares']
    """
    if function is not None:
        return Table(function)
    over = rows

    def build(**values: Any) -> tuple[list[str], list[list[str]]]:
        name = over.name if isinstance(over, Declaration) else over
        heads, cells = [name], [[str(label)] for label in values[name].values.tolist()]
        for column, form in columns.items():
            value = values[column]
            others = [one for one in value.dims if one != name]
            unit = value.attrs.get("units", "")
            for labels in product(*(value[one].values.tolist() for one in others)):
                part = value.sel(dict(zip(others, labels, strict=True)))
                title = " ".join([column.replace("_", " "), *map(str, labels)])
                heads.append(f"{title} [{unit}]" if unit not in ("", "1") else title)
                for row, one in zip(cells, part.values.tolist(), strict=True):
                    row.append(form.format(one))
        return heads, cells

    return _Columns(build, over, tuple(columns))


class _Columns(Table):
    """A table with one column for each array."""

    def __init__(self, function: Function, rows: Any, columns: tuple[str, ...]) -> None:
        super().__init__(function)
        self._rows, self._columns = rows, columns

    @property
    def needs(self) -> tuple[str, ...]:
        rows = self._rows.name if isinstance(self._rows, Declaration) else self._rows
        return (rows, *self._columns)

    def value(self, study: Any, get: Get) -> Any:
        assert self.function is not None
        return self.function(**{name: get(name) for name in self.needs})


class Drawn(Declaration):
    """A figure, or several by name."""

    def figures(self, study: Any, get: Get) -> dict[str, Figure]:
        value = self.value(study, get)
        every = value if isinstance(value, Mapping) else {stem(self.name): value}
        return {
            name: figures.with_figure_numbers(one, *figures.numbers_in(name))
            for name, one in every.items()
            if one is not None
        }


def figure(function: Function) -> Any:
    """Declare a figure: a function of stored arrays that returns it (see `workbench.figures`).

    It may also return a mapping from names to figures; None gives no figure. The number in a name
    such as ``figure-8-7`` is put into the figure's caption.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> from workbench import Study, solve
    >>> from workbench.study import array, dim, figure
    >>> @dataclass(frozen=True)
    ... class Squares(Study):
    ...     '''Squares of some numbers.'''
    ...
    ...     number = dim(1, 2, 3)
    ...     square = array(dims=number, unit="1", meaning="square", value=lambda number: number**2)
    ...
    ...     @figure
    ...     def parabola(number, square):
    ...         from matplotlib.figure import Figure
    ...
    ...         drawing = Figure()
    ...         drawing.subplots().plot(number, square)
    ...         return drawing
    ...
    >>> study = Squares()
    >>> list(study.figures(solve(study).answer))
    ['parabola']
    """
    return Drawn(function)


def lines(
    name: str,
    *,
    x: str,
    each: str | None = None,
    log: str = "xy",
    limit: float | None = None,
    title: str = "",
) -> Any:
    """Declare a line plot: an array over one dimension, with a line for each label of another.

    Parameters
    ----------
    name, x, each
        The array, the dimension of the horizontal axis, and the dimension with one line for each
        label.
    log
        Which axes are logarithmic: "x", "y", "xy" or "".
    limit
        A level that is drawn as a horizontal line.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> from workbench import Study, solve
    >>> from workbench.study import array, dim, lines
    >>> @dataclass(frozen=True)
    ... class Squares(Study):
    ...     '''Squares of some numbers.'''
    ...
    ...     number = dim(1, 2, 3)
    ...     square = array(dims=number, unit="1", meaning="square", value=lambda number: number**2)
    ...     parabola = lines("square", x="number", log="", limit=5.0)
    ...
    >>> study = Squares()
    >>> list(study.figures(solve(study).answer))
    ['parabola']
    """
    return _Lines(name, x, each, log, limit, title)


class _Lines(Drawn):
    def __init__(
        self, array: str, x: str, each: str | None, log: str, limit: float | None, title: str
    ) -> None:
        super().__init__(None)
        self.array, self.x, self.each = array, x, each
        self.log, self.limit, self.title = log, limit, title

    def figures(self, study: Any, get: Get) -> dict[str, Figure]:
        values = get(self.array)
        drawn, (panel,) = figures.axes(1, 1)
        labels = [None] if self.each is None else values[self.each].values.tolist()
        for label in labels:
            one = values if label is None else values.sel({self.each: label})
            panel.plot(values[self.x].values, one.values, label=label)
        if self.limit is not None:
            panel.axhline(self.limit, color=figures.BLACK, linewidth=0.8, linestyle="--")
        across, up = (
            figures.axis_label(a, n) for a, n in ((values[self.x], self.x), (values, self.array))
        )
        figures.label(panel, x=across, y=up, title=self.title, log=self.log)
        if self.each is not None:
            figures.legend_below(drawn, panel)
        return {stem(self.name): drawn}


def stem(name: str) -> str:
    """The name of a table or figure as used in file names."""
    return name.strip("_").replace("_", "-")
