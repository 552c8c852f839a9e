"""Controllers with some entries equal to zero."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from workbench.errors import InputError
from workbench.synthesis.families.entries import EntryFamilies, EntryPlace
from workbench.synthesis.families.family import Family, need_family, need_size


@dataclass(frozen=True, init=False)
class Sparse(EntryFamilies):
    """A transfer matrix with some entries zero, and a family of controllers for each other entry.

    ``rows`` has a row for each control and a column for each measurement: a family with one input
    and one output, or None for an entry that is zero. ``Static()`` is a gain. Each entry has its
    own states, so that a zero entry stays zero.

    Examples
    --------
    >>> from workbench.synthesis import PI, Sparse, Static
    >>> family = Sparse([[PI(), None], [Static(), PI()]])
    >>> family.count, family.shape
    (5, (2, 2))
    >>> float(family.system([1.0, 2.0, 3.0, 4.0, 5.0]).D[1, 0])
    3.0
    """

    rows: tuple[tuple[Family | None, ...], ...]

    def __init__(self, rows: Iterable[Iterable[Family | None]]) -> None:
        what = "rows of families, None where K is zero: Sparse([[PI(), None], [None, PI()]])"
        if isinstance(rows, str) or not isinstance(rows, Iterable):
            raise InputError(f"rows is {rows!r}; give {what}")
        given = list(rows)
        if any(isinstance(row, str) or not isinstance(row, Iterable) for row in given):
            raise InputError(f"rows is {rows!r}; give {what}")
        table = [list(row) for row in given]
        if not table or len({len(row) for row in table}) > 1 or not table[0]:
            raise InputError(
                f"rows have {', '.join(str(len(row)) for row in table) or 'no'} entries; each "
                "control needs a row, with one entry for each measurement"
            )
        for i, row in enumerate(table):
            for j, each in enumerate(row):
                if each is not None:
                    need_family(each, f"the entry of output {i} and input {j}")
        if not any(each is not None for row in table for each in row):
            raise InputError(f"every entry is zero: give {what}")
        sized = tuple(
            tuple(None if each is None else each.sized(1, 1) for each in row) for row in table
        )
        object.__setattr__(self, "rows", sized)

    def __repr__(self) -> str:
        return f"Sparse([{', '.join(str(list(row)) for row in self.rows)}])"

    @property
    def shape(self) -> EntryPlace:
        return len(self.rows), len(self.rows[0])

    @property
    def entries(self) -> Mapping[EntryPlace, Family]:
        return {
            (i, j): family
            for i, row in enumerate(self.rows)
            for j, family in enumerate(row)
            if family is not None
        }

    def with_entries(self, families: Sequence[Family]) -> Sparse:
        own = dict(zip(self.entries, families, strict=True))
        outputs, inputs = self.shape
        return Sparse([[own.get((i, j)) for j in range(inputs)] for i in range(outputs)])

    def place_name(self, place: EntryPlace) -> str:
        return f"entry {place[0] + 1},{place[1] + 1}"

    def sized(self, inputs: int, outputs: int) -> Sparse:
        do = "there must be a row for each control and a column for each measurement"
        need_size(self, self.shape[::-1], inputs, outputs, do)
        return self
