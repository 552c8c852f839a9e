"""Puts an error into one module of the workbench, in a process of its own: a plugin of pytest.

    WORKBENCH_MUTANT='{"module": ..., "old": ..., "new": ...}' python -m pytest -p mutated ...

The module is imported from its changed text; nothing is written into the checkout.
"""

from __future__ import annotations

import importlib.util
import json
import os
import sys
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from types import CodeType

MUTANT = "WORKBENCH_MUTANT"
"""Variable of the environment with module, old text and new text."""
COMPILED = "from workbench._core.compiled import compiled\n"
"""Compiled code is kept by the file's time of change; of a changed text none may be kept."""


def changed(text: str, old: str, new: str) -> str:
    """The text of a module with an error in it; ValueError unless the old text is there once."""
    if text.count(old) != 1:
        raise ValueError(f"{old!r} stands {text.count(old)} times in the module")
    return text.replace(old, new).replace(COMPILED, "from numba import njit as compiled\n")


class _Loader(SourceFileLoader):
    def get_code(self, fullname: str) -> CodeType:
        edit = json.loads(os.environ[MUTANT])
        text = self.get_data(self.path).decode()
        return self.source_to_code(changed(text, edit["old"], edit["new"]), self.path)


class _Finder(PathFinder):
    @classmethod
    def find_spec(cls, fullname, path=None, target=None) -> ModuleSpec | None:
        if fullname != json.loads(os.environ[MUTANT])["module"]:
            return None
        spec = super().find_spec(fullname, path, target)
        assert spec is not None and spec.origin is not None, fullname
        return importlib.util.spec_from_file_location(
            fullname, spec.origin, loader=_Loader(fullname, spec.origin)
        )


if MUTANT in os.environ:
    assert not any(name.startswith("workbench.") for name in sys.modules), "imported before"
    sys.meta_path.insert(0, _Finder)
