"""The order of many problems: which must end before which others begin."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from workbench.bench.declare import Ref
from workbench.bench.project import registry
from workbench.errors import WorkbenchError

UNASKED = {"tolerance": "middle", "time_limit": None, "verbose": False, "fresh": False}
"""Options of a run that the user does not set; needed problems run with these options."""


class JobPlan:
    """The given problems and the problems that they need, each once.

    Parameters
    ----------
    names
        Names of problems.
    asked
        Arguments of `workbench.run` for all of them.

    Attributes
    ----------
    calls : dict
        Name and arguments of each run, by label.
    named : dict
        The names that were given, by label. A run without a name here is only needed by others.
    waiting : list of str
        Labels of the runs that have not begun; those that most others need come first.
    over : set of str
        Labels of the runs that have ended; the caller adds them.
    """

    def __init__(self, names: Sequence[str], asked: Mapping[str, Any]) -> None:
        options = {name: asked.get(name, usual) for name, usual in UNASKED.items()}
        options["seed"] = asked.get("seed", 0)
        parameters = {k: v for k, v in asked.items() if k not in {*options, "method"}}
        self.calls: dict[str, tuple[str, dict[str, Any]]] = {}
        self.over: set[str] = set()
        self._needs: dict[str, set[str]] = {}
        self.named = {
            self._add(Ref(name, asked.get("method"), parameters), options): name for name in names
        }
        needed = self._needed()
        self.waiting = sorted(self.calls, key=lambda label: -len(needed[label]))

    def _add(self, one: Ref, options: Mapping[str, Any]) -> str:
        """The label of a run; the run is added together with all runs that it needs."""
        parameters: Mapping[str, Any] = one.parameters
        needs: list[Ref] = []
        try:
            problem = registry().find(one.name)
            bound = problem.bind(parameters)
            parameters = problem.to_json(bound)
            for need in problem.needs(bound).values():
                needs += need if isinstance(need, list) else [need]
        except WorkbenchError:
            needs = []  # its run reports what is wrong
        label = json.dumps([one.name, one.method, parameters, options], sort_keys=True, default=str)
        if label not in self.calls:
            self.calls[label] = one.name, {"method": one.method, **options, **one.parameters}
            # added before its needs, since cyclic needs may lead back to it
            self._needs[label] = set()
            usual = {**UNASKED, "seed": options["seed"]}
            self._needs[label] |= {self._add(need, usual) for need in needs}
        return label

    def _needed(self) -> dict[str, set[str]]:
        """For each run the labels of all runs that need it, directly or through others."""
        needed: dict[str, set[str]] = {label: set() for label in self.calls}
        for label in self.calls:
            below = list(self._needs[label])
            while below:
                need = below.pop()
                if label not in needed[need]:
                    needed[need].add(label)
                    below += self._needs[need]
        return needed

    def ready(self, most: int, *, idle: bool) -> Iterator[str]:
        """Labels of at most so many runs that can begin now; they are removed from ``waiting``.

        If nothing is running and all runs wait for one another, the first one begins, and reports
        the cycle.
        """
        free = [label for label in self.waiting if self._needs[label] <= self.over][:most]
        for label in free or (self.waiting[:1] if idle else []):
            self.waiting.remove(label)
            yield label
