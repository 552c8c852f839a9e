"""Compiled code is kept on disk, and never outlives the source that it is made from."""

import subprocess
import sys

import numpy as np
import pytest
from numba.core.errors import TypingError

from workbench._core.compiled import kernel

INNER = "from workbench._core.compiled import compiled\n\n@compiled\ndef inner(x):\n    return {}\n"
OUTER = (
    "from workbench._core.compiled import compiled\nfrom room.inner import inner\n\n"
    "@compiled\ndef outer(x):\n    return inner(x) + 1\n"
)
CALL = (
    "from room.outer import outer\nvalue = outer(3.0)\n"
    "print(value, sum(outer.stats.cache_hits.values()))"
)


@pytest.fixture
def room(tmp_path):
    folder = tmp_path / "room"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "inner.py").write_text(INNER.format("10 * x"))
    (folder / "outer.py").write_text(OUTER)
    return folder


AS_THE_REGISTRY_DOES = (
    "import sys, types\nmade = types.ModuleType('made')\nmade.__path__ = ['.']\n"
    "sys.modules['made'] = made\n"
)


def call(room, code=CALL):
    """Value and cache hits in a new process."""
    done = subprocess.run(
        [sys.executable, "-B", "-c", code],
        cwd=room.parent,
        capture_output=True,
        text=True,
        check=True,
    )
    value, hits = done.stdout.split()
    return float(value), int(hits)


@pytest.mark.cases(0)
def test_compiled_code_is_reused_until_any_file_of_its_room_changes(room):
    assert call(room) == (31.0, 0)
    assert call(room) == (31.0, 1)
    (room / "inner.py").write_text(INNER.format("20 * x"))  # outer.py is as it was
    assert call(room) == (61.0, 0)
    (room / "inner.py").write_text(INNER.format("10 * x"))
    assert call(room)[0] == 31.0


WAITING = """
import sys
from pathlib import Path
from room import outer as module
from workbench._core import compiled
Path(sys.argv[1]).touch()
while not all(Path(f"ready{k}").exists() for k in range(2)):
    pass
module.outer(3.0)
print(sum(module.outer.stats.cache_misses.values()), sum(module.outer.stats.cache_hits.values()))
"""


def test_two_processes_that_need_the_same_code_compile_it_once(room):
    words = [sys.executable, "-B", "-c", WAITING]
    both = [
        subprocess.Popen([*words, f"ready{k}"], cwd=room.parent, stdout=subprocess.PIPE, text=True)
        for k in range(2)
    ]
    assert sorted(process.communicate()[0] for process in both) == ["0 1\n", "1 0\n"]


@pytest.mark.cases(0)
def test_code_is_compiled_where_no_lock_can_be_made(room, monkeypatch):
    (room / "__pycache__").mkdir()
    for name in ("inner.inner-3", "outer.outer-4"):  # a folder where the lock would be
        major = f"py{sys.version_info.major}{sys.version_info.minor}"
        (room / "__pycache__" / f"{name}.{major}.nbi.lock").mkdir()
    assert call(room) == (31.0, 0)
    assert call(room) == (31.0, 1)


@pytest.mark.slow
def test_files_that_nothing_imports_compile_nothing_anew(room):
    call(room)
    (room / "other.py").write_text("from room.outer import outer\n")
    assert call(room) == (31.0, 1)


@pytest.mark.slow
def test_a_change_in_another_room_is_seen_and_so_is_one_behind_it(room):
    below = room / "below"
    below.mkdir()
    (below / "__init__.py").touch()
    (below / "factor.py").write_text("TEN = 10.0\n")
    inner = INNER.replace("\n\n@", "\nfrom room.below.factor import TEN\n\n@", 1)
    (room / "inner.py").write_text(inner.format("TEN * x"))
    assert call(room) == (31.0, 0)
    assert call(room) == (31.0, 1)
    (below / "factor.py").write_text("TEN = 30.00\n")
    assert call(room) == (91.0, 0)


@pytest.mark.slow
def test_code_of_a_package_made_by_hand_is_kept_apart(room):
    """It names a module that an ordinary process cannot import."""
    (room / "outer.py").write_text(OUTER.replace("room.inner", ".inner"))
    by_hand = AS_THE_REGISTRY_DOES + CALL.replace("room.outer", "made.room.outer")
    assert call(room, by_hand) == (31.0, 0)
    assert call(room) == (31.0, 0)
    assert call(room, by_hand) == (31.0, 1)
    assert call(room) == (31.0, 1)


def _double(values):
    for i in range(len(values)):
        values[i] *= 2.0


def _make(values):
    return np.zeros(len(values))


def test_a_kernel_makes_no_array():
    values = np.arange(3.0)
    kernel(_double)(values)
    assert values.tolist() == [0.0, 2.0, 4.0]
    with pytest.raises(TypingError, match="zeros"):
        kernel(_make)(values)


def test_functions_of_others_that_have_no_module_compile():
    import numba

    kernel(call)  # from the first function of the project on, Numba tells it what is compiled
    namespace: dict = {}
    exec("def double(x):\n    return 2 * x", namespace)
    function = namespace["double"]
    function.__module__ = None
    assert numba.njit(function)(3) == 6
