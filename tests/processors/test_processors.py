"""A sample of `make test-processors`; what it and `make test-all` stand on: the proof, the parts,
what is kept."""

import json
import os
import platform
import re
import subprocess
import sys

import pytest
import run
from emulations import EMULATIONS, ROOT, disabled, environment
from oldest import requirements
from parts import CHUNKS, HERE, PARTS, Room, files_of, files_of_tests
from proof import differences, observed

REFERENCE = ROOT / "results" / "reference"
PROCESSORS = str(ROOT / "tests" / "processors")
SAMPLE = {
    "bounds": ("prescott", ("quick/distillation/*", "quick/mass-spring/*", "cd/focus/stadiums")),
    "metrics": (
        "haswell",
        ("textbook/*/record-feedback", "two-by-two/matrix-cover", "cd/radial/identified"),
    ),
}
"""An emulation, and stored runs that cost little to verify and hang most on rounding."""
VERIFY = """
import sys
from emulations import EMULATIONS
from proof import differences, observed

name, native, *folders = sys.argv[1:]
print(differences(EMULATIONS[name], observed(), native))

import workbench as wb

for folder in folders:
    verification = wb.verify(folder)
    if not verification.holds:
        print(verification)
"""


@pytest.fixture(scope="module")
def here():
    if (platform.libc_ver()[0], platform.machine()) != ("glibc", "x86_64"):
        pytest.skip("the emulations are those of the wheels for Linux on x86-64")
    if "NPY_DISABLE_CPU_FEATURES" in os.environ:
        pytest.skip("these tests run under an emulation themselves")
    return observed()


@pytest.mark.cases(1)
@pytest.mark.parametrize(("name", "runs"), SAMPLE.values(), ids=SAMPLE)
def test_a_sample_of_stored_runs_is_verified_on_another_processor(name, runs, here):
    """These runs need no compiled code, which it would take minutes to compile anew."""
    emulation = EMULATIONS[name]
    if emulation.needs not in here["features"]:
        pytest.skip(f"this processor lacks {emulation.needs}")
    folders = [str(one) for names in runs for one in sorted(REFERENCE.glob(f"{names}/*"))]
    assert len(folders) >= len(runs)
    done = subprocess.run(
        [sys.executable, "-c", VERIFY, name, here["libm"], *folders],
        cwd=ROOT,
        env=environment(emulation, here["dispatched"]) | {"PYTHONPATH": PROCESSORS},
        capture_output=True,
        text=True,
    )
    assert done.stdout == "[]\n" and done.returncode == 0, done.stdout + done.stderr


FOUND = {
    "blas": {"numpy.libs": ["Haswell", 1], "scipy.libs": ["Haswell", 1]},
    "dispatched": ["X86_V3"],
    "features": ["AVX2", "FMA3", "X86_V3"],
    "libm": "0x1",
    "numba": ["haswell", ""],
}
OTHER = {
    "another kernel": ({"blas": {**FOUND["blas"], "scipy.libs": ["SkylakeX", 1]}}, "SkylakeX"),
    "no OpenBLAS": ({"blas": {}}, "is needed"),
    "two threads": ({"blas": {**FOUND["blas"], "numpy.libs": ["Haswell", 2]}}, "2 threads"),
    "instructions left": ({"dispatched": ["X86_V3", "X86_V4"]}, "X86_V4"),
    "instructions lacking": ({"features": ["SSE3"]}, "lacks AVX2"),
    "another target": ({"numba": ["znver5", ""]}, "znver5"),
    "the target's extras": ({"numba": ["haswell", "+avx512f"]}, "+avx512f"),
}


@pytest.mark.parametrize(("changed", "told"), OTHER.values(), ids=OTHER)
def test_an_emulation_that_is_not_in_effect_is_noticed(changed, told):
    assert differences(EMULATIONS["haswell"], FOUND, "0x1") == []
    (wrong,) = differences(EMULATIONS["haswell"], FOUND | changed, "0x1")
    assert told in wrong


def test_a_c_library_that_uses_what_the_emulation_lacks_is_noticed():
    one = {"numpy.libs": ["Prescott", 1], "scipy.libs": ["Katmai", 1]}
    found = FOUND | {"blas": one, "dispatched": [], "numba": ["generic", ""]}
    found["features"] = ["SSE3", "FMA3"]
    assert differences(EMULATIONS["prescott"], found, "0x2") == []
    assert differences(EMULATIONS["prescott"], found, "0x1") == ["the C library still uses FMA"]


def test_features_have_the_names_of_the_numpy_at_hand():
    new, old = ["X86_V3", "X86_V4", "AVX512_ICL"], ["SSE42", "AVX2", "AVX512F", "AVX512_SKX"]
    assert disabled("baseline", new) == new and disabled("baseline", old) == old
    assert disabled("AVX2", new) == new[1:] and disabled("AVX2", old) == old[2:]
    assert disabled("AVX-512", new) == disabled("AVX-512", old) == []


def test_every_test_is_of_one_kind():
    kinds = [*files_of("stored"), *files_of("numbers"), *files_of("tests")]
    assert sorted(kinds) == files_of_tests()
    names = {name.rpartition("/")[2] for name in files_of("numbers")}
    assert names >= {
        *("test_code_of_pages.py", "test_examples_of_names.py", "test_notebooks.py"),
        *("test_page.py", "test_technical_report.py", "test_thesis.py", "test_designs.py"),
    }
    numbers = [part for part in PARTS.values() if part.emulation and part.kind == "numbers"]
    chunks = [part.command(ROOT)[-1] for part in numbers]
    assert len(chunks) == len(EMULATIONS) * CHUNKS["numbers"]


def test_every_test_is_in_one_part_here():
    parts = [part for name, part in PARTS.items() if name.startswith(f"{HERE}/")]
    words = [word for part in parts for word in part.command(ROOT)]
    assert sorted(word for word in words if word.endswith(".py")) == files_of_tests()
    assert "-m" not in [word for part in parts for word in part.command(ROOT)[3:]]


def test_the_oldest_versions_are_those_of_pyproject():
    pinned = (ROOT / "requirements.txt").read_text(encoding="utf-8").splitlines()
    changed = [line for line in requirements().splitlines() if line not in pinned]
    assert [line.partition("==")[0] for line in changed] == ["numpy", "scipy"]


@pytest.fixture
def part(tmp_path, monkeypatch):
    """A part that counts how often it is run, in an emulation that is in effect."""
    code = "from pathlib import Path; import sys; f = Path('{}').open('a'); f.write('x'); {}"

    class Counted(run.Part):
        end = "print('FAILED tests/test_a.py::test_b - no'); sys.exit(1)"

        def command(self, results):
            return [sys.executable, "-c", code.format(tmp_path / "runs", self.end)]

    monkeypatch.setattr(run, "ROOT", tmp_path)
    monkeypatch.setattr(run, "KEPT", tmp_path / ".processors")
    monkeypatch.setattr(run, "native", lambda venv: {"features": ["SSE3"]})
    monkeypatch.setattr(run, "variables", lambda emulation: None)
    monkeypatch.setattr(run, "proven", lambda emulation: ("first", ""))
    return Counted(EMULATIONS["prescott"], "stored", 0)


def test_a_part_is_run_once_for_the_same_files(part, tmp_path, monkeypatch):
    found = run.result(part)
    assert found["failed"] == ["tests/test_a.py::test_b"]
    assert found["log"] == ".processors/prescott/first/stored.log"
    assert run.result(part) == found and (tmp_path / "runs").read_text() == "x"
    monkeypatch.setattr(run, "proven", lambda emulation: ("second", ""))
    type(part).end = "pass"
    assert run.result(part)["failed"] == [] and (tmp_path / "runs").read_text() == "xx"
    assert [one.name for one in run.KEPT.glob("*/*") if one.is_dir()] == ["second"]


def test_when_a_part_last_passed_is_kept_beyond_a_change_of_files(part, monkeypatch):
    type(part).end = "pass"
    assert run.last_passed(part.name) == "never"
    assert run.result(part)["failed"] == []
    passed = run.last_passed(part.name)
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d, 0 min", passed)
    monkeypatch.setattr(run, "proven", lambda emulation: ("second", ""))
    type(part).end = "sys.exit(3)"
    assert run.result(part)["failed"] and run.last_passed(part.name) == passed != "never"


def test_a_room_is_run_on_this_processor_as_it_is(tmp_path, monkeypatch):
    monkeypatch.setattr(run, "KEPT", tmp_path / ".processors")
    monkeypatch.setattr(run, "ROOT", tmp_path)
    monkeypatch.setattr(run, "files_key", lambda: "files")
    code = "import os, sys; sys.exit(os.environ['OMP_NUM_THREADS'] != '1')"
    monkeypatch.setattr(Room, "command", lambda room, results: [sys.executable, "-c", code])
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    run.proven.cache_clear()
    assert run.result(PARTS[f"{HERE}/optics"])["failed"] == []
    run.proven.cache_clear()


def test_a_part_whose_emulation_is_not_in_effect_fails(part, tmp_path, monkeypatch):
    monkeypatch.setattr(run, "proven", lambda emulation: ("first", "it runs Haswell"))
    assert run.result(part)["failed"] == ["it runs Haswell"]
    assert not (tmp_path / "runs").exists()


def test_a_processor_that_cannot_be_played_is_left_out(part, monkeypatch):
    monkeypatch.setattr(run, "native", lambda venv: {"features": []})
    assert run.result(part) is None


def test_versions_that_cannot_be_installed_fail_their_parts(part, monkeypatch):
    def refused(venv):
        raise subprocess.CalledProcessError(2, ["make", f"{venv}/.ready"])

    monkeypatch.setattr(run, "native", refused)
    (told,) = run.result(part)["failed"]
    assert ".venv/.ready" in told


def test_a_run_that_ends_without_a_summary_fails(part):
    type(part).end = "sys.exit(3)"
    assert run.result(part)["failed"] == ["exit status 3"]


def test_the_table_says_what_failed_where(tmp_path, monkeypatch):
    monkeypatch.setattr(run, "KEPT", tmp_path)
    good = {"failed": [], "minutes": 2.2, "log": "a.log"}
    bad = {"failed": ["tests/test_a.py::test_b"], "minutes": 3.0, "log": "b.log"}
    table = run.shown({"prescott/stored": good, "haswell/stored": bad, "skylakex/stored": None})
    rows = {line.split()[0]: line.split()[1:] for line in table.splitlines() if line}
    assert rows["prescott/stored"] == ["ok", "2", "never"]
    assert rows["haswell/stored"] == ["1", "FAILED", "3", "never"]
    assert rows["skylakex/stored"] == ["left", "out", "never"]
    assert rows["prescott/chain"] == ["-", "never"] and f"{HERE}/mu-1" not in rows
    assert table.endswith("haswell/stored: b.log\ntests/test_a.py::test_b")


def test_the_names_of_parts_are_a_matrix_of_the_workflow():
    command = [sys.executable, run.__file__, "--list", "prescott/*", "*/chain"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert len(json.loads(done.stdout)) == sum(CHUNKS.values()) + len(EMULATIONS) - 1
