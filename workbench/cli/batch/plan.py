"""What of many problems must end before what else begins."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from workbench.bench.declare import Ref
from workbench.bench.project import registry
from workbench.errors import WorkbenchError

UNASKED = {"tolerance": "middle", "time_limit": None, "verbose": False, "fresh": False}
"""What a run means that says nothing of these; so are those that feed others."""


class JobPlan:
    """Problems, and what they are fed with, each once.

    Parameters
    ----------
    names
        Names of problems.
    asked
        What is asked of all of them, as `workbench.run` takes it.

    Attributes
    ----------
    calls : dict
        The name of a problem and what is asked of it, by label.
    named : dict
        The names that were given, by label. What has no name here only feeds others.
    waiting : list of str
        Labels of what has not begun, those first that most others need.
    over : set of str
        Labels of what has ended; whoever runs them adds them.
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
        """The label of a question, which is added with all that it is fed with."""
        parameters: Mapping[str, Any] = one.parameters
        needs: list[Ref] = []
        try:
            problem = registry().find(one.name)
            bound = problem.bind(parameters)
            parameters = problem.to_json(bound)
            for need in problem.needs(bound).values():
                needs += need if isinstance(need, list) else [need]
        except WorkbenchError:
            needs = []  # its run says what is wrong
        label = json.dumps([one.name, one.method, parameters, options], sort_keys=True, default=str)
        if label not in self.calls:
            self.calls[label] = one.name, {"method": one.method, **options, **one.parameters}
            self._needs[label] = set()  # known before its needs are: they may lead back to it
            usual = {**UNASKED, "seed": options["seed"]}
            self._needs[label] |= {self._add(need, usual) for need in needs}
        return label

    def _needed(self) -> dict[str, set[str]]:
        """What waits for each of them, at first hand or later."""
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
        """Labels of at most so many that may begin, which wait no longer.

        Where nothing is under way and all wait for one another the first one begins: it says so.
        """
        free = [label for label in self.waiting if self._needs[label] <= self.over][:most]
        for label in free or (self.waiting[:1] if idle else []):
            self.waiting.remove(label)
            yield label
