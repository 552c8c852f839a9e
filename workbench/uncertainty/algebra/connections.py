"""Connections of uncertain systems: in parallel, in series, in blocks, and in a loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.linalg import block_diag as block_diagonal

from workbench.errors import InputError
from workbench.input_checks import as_list
from workbench.systems.balancing import singular
from workbench.uncertainty.algebra.lft import diagonal, linked
from workbench.uncertainty.algebra.signals import named, need_naming
from workbench.uncertainty.algebra.system import (
    UncertainSystem,
    combined_elements,
    common_time,
    uncertain,
    with_channels,
)


def append(*sys: Any, **kwargs: Any) -> UncertainSystem:
    """Block diagonal system: the inputs and outputs of the first system, then of the second, ...

    Keywords name the result and its signals, as those of `control.append` do.

    Examples
    --------
    >>> from workbench.uncertainty import append, real, tf
    >>> two = append(tf([1], [1, real("a", 1, percent=20)]), 3.0)
    >>> two.noutputs, two.ninputs
    (2, 2)
    """
    need_naming("append", kwargs)
    parts = _systems(sys, "append")
    value = diagonal(*(part.value for part in parts))
    return named(UncertainSystem(value, combined_elements(parts), dt=common_time(parts)), kwargs)


def series(*sys: Any, **kwargs: Any) -> UncertainSystem:
    """Systems in series; the first one comes first, so series(G, H) is H G.

    Keywords name the result and its signals, as those of `control.series` do.

    Raises InputError for sizes or sampling times that do not fit.

    Examples
    --------
    >>> from workbench.uncertainty import real, series, tf
    >>> float(series(tf([1], [1, real("a", 2, percent=20)]), 3.0).nominal.dcgain())
    1.5
    """
    need_naming("series", kwargs)
    first, *others = _systems(sys, "series")
    for other in others:
        first = other * first
    return named(first, kwargs)


def _systems(given: tuple[Any, ...], function: str) -> list[UncertainSystem]:
    """The given systems; raises InputError if there are none."""
    if not given:
        raise InputError(f"{function} needs at least one system")
    return [with_channels(one, f"system {k}") for k, one in enumerate(given, start=1)]


def block(rows: Sequence[Sequence[Any]]) -> UncertainSystem:
    """A system composed of blocks as in `numpy.block`: [[a, b], [c, d]].

    Blocks of a row have the same outputs, and blocks of a column the same inputs. Each block is a
    system or a model of any kind, a number or an array. No element occurs more often than in the
    blocks.

    Raises InputError for rows of different lengths, sizes or sampling times that do not fit.

    Examples
    --------
    >>> from workbench.uncertainty import block, real, tf
    >>> G = tf([1], [1, real("a", 1, percent=20)])
    >>> block([[G, 1.0], [0.0, G]]).noutputs
    2
    """
    given = [as_list(row, f"row {i}") for i, row in enumerate(as_list(rows, "rows"), start=1)]
    lengths = {len(row) for row in given}
    if len(lengths) != 1 or not lengths.pop():
        raise InputError(
            f"rows have {[len(row) for row in given]} blocks; they need the same number"
        )
    parts = [
        [with_channels(one, f"block {i}, {j}") for j, one in enumerate(row, start=1)]
        for i, row in enumerate(given, start=1)
    ]
    heights, widths = [row[0].noutputs for row in parts], [one.ninputs for one in parts[0]]
    for i, row in enumerate(parts, start=1):
        for j, one in enumerate(row, start=1):
            if (one.noutputs, one.ninputs) != (heights[i - 1], widths[j - 1]):
                raise InputError(
                    f"block {i}, {j} has {one.noutputs} outputs and {one.ninputs} inputs; its row "
                    f"has {heights[i - 1]} outputs, its column {widths[j - 1]} inputs"
                )
    flat = [one for row in parts for one in row]
    whole = diagonal(*(one.value for one in flat))
    outputs, inputs = whole.shape
    enters = np.vstack([block_diagonal(*(np.eye(width) for width in widths))] * len(parts))
    leaves = block_diagonal(*(np.hstack([np.eye(height)] * len(widths)) for height in heights))
    value = linked(whole, np.zeros((inputs, outputs)), enters, leaves)
    return UncertainSystem(value, combined_elements(flat), dt=common_time(flat))


def feedback(sys1: Any, sys2: Any = 1, sign: int = -1, **kwargs: Any) -> UncertainSystem:
    """The loop y = sys1 (u + sign sys2 y); no element occurs more often than in sys1 and sys2.

    Keywords name the result and its signals, as those of `control.feedback` do.

    Raises
    ------
    InputError
        Sizes or sampling times do not fit; the sign is not -1 or 1; or the loop is singular through
        the direct terms at the nominal.
    """
    need_naming("feedback", kwargs)
    a, b = with_channels(sys1, "sys1"), with_channels(sys2, "sys2")
    if b.value.shape == (1, 1) and not b.nstates and not b.elements and a.noutputs > 1:
        b = uncertain(float(b.value.M[0, 0]) * np.eye(a.noutputs))
    if (b.noutputs, b.ninputs) != (a.ninputs, a.noutputs):
        raise InputError(
            f"sys1 has {a.ninputs} inputs and {a.noutputs} outputs, sys2 {b.ninputs} and "
            f"{b.noutputs}; they must fit each other"
        )
    if isinstance(sign, bool) or sign not in (-1, 1):
        raise InputError(f"sign is {sign!r}; it must be -1 or 1")
    whole = diagonal(a.value, b.value)
    p, m = a.value.shape
    # v = [u; 0] + [0, sign I; I, 0] [y; x], x = sys2 y
    links = np.block([[np.zeros((m, p)), sign * np.eye(m)], [np.eye(p), np.zeros((p, m))]])
    if singular(np.eye(m + p) - links @ whole.blocks[3]):
        raise not_well_posed("first", a, "second", b)
    value = linked(whole, links, np.eye(m + p, m), np.eye(p, p + m))
    parts = [a, b]
    return named(UncertainSystem(value, combined_elements(parts), dt=common_time(parts)), kwargs)


def not_well_posed(
    first: str, one: UncertainSystem, second: str, other: UncertainSystem
) -> InputError:
    """The error for a loop of two named systems that is singular because of their direct terms."""
    direct = (str(each.value.blocks[3].tolist()) for each in (one, other))
    return InputError(
        "the loop is not well posed: it is singular through the direct terms of its parts at the "
        f"nominal, {next(direct)} of {first} and {next(direct)} of {second}; give one of them a "
        "lag, or another gain"
    )
