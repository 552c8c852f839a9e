"""A controller with one input and one output for each channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.synthesis.families.entries import EntryFamilies, EntryPlace
from workbench.synthesis.families.family import Family, need_family, need_size


@dataclass(frozen=True, init=False)
class Decentralised(EntryFamilies):
    """A diagonal K: a controller with one input and one output for each channel.

    Examples
    --------
    >>> from workbench.synthesis import PI, PID, Decentralised
    >>> Decentralised(PID(), PI()).counts
    (4, 2)
    >>> family, x = Decentralised.of([PID.of(2.0, 1.0, 0.1, 0.01)] * 2)
    >>> family.counts, family.system(x).ninputs
    ((4, 4), 2)
    """

    channels: tuple[Family, ...]

    def __init__(self, *channels: Family) -> None:
        if not channels:
            raise InputError("no channels are given; Decentralised(PID(), PI()) has two")
        for number, each in enumerate(channels, start=1):
            need_family(each, f"channel {number}")
        sized = tuple(each.sized(1, 1) for each in channels)
        object.__setattr__(self, "channels", sized)

    def __repr__(self) -> str:
        return f"Decentralised({', '.join(map(repr, self.channels))})"

    @classmethod
    def of(cls, members: Sequence[tuple[Family, RealArray]]) -> tuple[Decentralised, RealArray]:
        """The family and its parameters, from the families and parameters of the channels as `of`
        gives them.
        """
        families, parts = zip(*members, strict=True)
        return cls(*families), np.concatenate(parts)

    @property
    def shape(self) -> EntryPlace:
        return len(self.channels), len(self.channels)

    @property
    def entries(self) -> Mapping[EntryPlace, Family]:
        return {(k, k): family for k, family in enumerate(self.channels)}

    def with_entries(self, families: Sequence[Family]) -> Decentralised:
        return Decentralised(*families)

    def place_name(self, place: EntryPlace) -> str:
        return f"channel {place[0] + 1}"

    def sized(self, inputs: int, outputs: int) -> Decentralised:
        do = "it needs one channel for each measurement and control"
        need_size(self, self.shape, inputs, outputs, do)
        return self

    @property
    def _says_zero(self) -> str:
        return "it is not diagonal"
