"""The registry: the problems of several folders, under one set of names."""

from __future__ import annotations

import fnmatch
from functools import cached_property
from pathlib import Path

from workbench.bench.discovery import Entry, scan
from workbench.bench.problem import Problem
from workbench.errors import RegistryError, UnknownNameError


class Registry:
    """The problems of several folders, under one set of names."""

    def __init__(self, roots: list[Path]) -> None:
        self.roots = roots
        self._problems: dict[str, Problem] = {}

    @cached_property
    def entries(self) -> dict[str, Entry]:
        """Every entry by name, sorted.

        Raises
        ------
        RegistryError
            Two functions claim one name.
        """
        found: dict[str, Entry] = {}
        for root in self.roots:
            for entry in scan(root):
                twin = found.setdefault(entry.name, entry)
                if twin is not entry:
                    raise RegistryError(
                        f"two problems are called {entry.name!r}: {twin.place} and {entry.place}"
                    )
        return dict(sorted(found.items()))

    def match(self, pattern: str) -> list[Entry]:
        """Entries whose name fits a shell pattern.

        Raises
        ------
        UnknownNameError
            None does.
        """
        found = [e for name, e in self.entries.items() if fnmatch.fnmatchcase(name, pattern)]
        if not found:
            raise UnknownNameError("problem", pattern, self.entries)
        return found

    def find(self, name: str) -> Problem:
        """The problem of that name, imported."""
        if name not in self.entries:
            raise UnknownNameError("problem", name, self.entries)
        if name not in self._problems:
            self._problems[name] = Problem(self.entries[name])
        return self._problems[name]
