"""Thousands of spoilt folders, project files and words: an error of ours, never a traceback."""

import json
import shutil
from contextlib import suppress

import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import workbench as wb
from workbench.bench.project import Project
from workbench.bench.store import seal
from workbench.cli import main
from workbench.errors import WorkbenchError

EASY = {"deadline": None, "suppress_health_check": list(HealthCheck), "derandomize": True}
FILES = ("run.json", "certificate.json", "metrics.json", "data.nc", "log.txt", "SHA256SUMS")
FOLDERS, ENTRIES, TABLES, WORDS = 4500, 2500, 2500, 500
"""How many of each in the slow lane: 10,000 in all."""

SPOILT = st.lists(
    st.tuples(st.integers(0, 10**6), st.one_of(st.binary(max_size=4), st.just(None))),
    min_size=1,
    max_size=6,
)
"""Places of a file, and what is written there; None cuts the file off there."""
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=6,
)
LANES = [
    pytest.param(100, id="few"),
    pytest.param(1, id="all", marks=pytest.mark.slow),
]
"""A hundredth in the fast lane."""


def spoil(content, edits):
    for place, written in edits:
        at = place % (len(content) + 1)
        content = content[:at] + (
            b"" if written is None else written + content[at + len(written) :]
        )
    return content


def look(path, root):
    """All that one does with a folder; what is refused is refused by an error of ours."""
    for call in (wb.verify, lambda one: repr(wb.open_run(one)), lambda _: wb.report(root)):
        with suppress(WorkbenchError):
            call(path)


@pytest.mark.cases(0)
@pytest.mark.parametrize("share", LANES)
def test_bytes_of_a_folder(project, share):
    run = wb.run("toy/root")
    whole = {name: (run.path / name).read_bytes() for name in FILES}

    @settings(max_examples=FOLDERS // share, **EASY)
    @given(st.sampled_from(FILES), SPOILT, st.booleans())
    def spoilt(name, edits, sealed):
        for one, content in whole.items():
            (run.path / one).write_bytes(content)
        (run.path / name).write_bytes(spoil(whole[name], edits))
        if sealed:
            seal(run.path)
        look(run.path, project.results)

    spoilt()


@pytest.mark.cases(0)
@pytest.mark.parametrize("share", LANES)
def test_entries_of_run_json_and_certificate(project, share):
    run = wb.run("toy/root")
    whole = {name: json.loads((run.path / name).read_text()) for name in FILES[:3]}
    names = sorted({key for one in whole.values() for key in one})

    @settings(max_examples=ENTRIES // share, **EASY)
    @given(st.sampled_from(FILES[:3]), st.sampled_from(names), JSON)
    def spoilt(name, key, value):
        for one, content in whole.items():
            (run.path / one).write_text(json.dumps(content))
        (run.path / name).write_text(json.dumps(whole[name] | {key: value}))
        seal(run.path)
        look(run.path, project.results)

    spoilt()


@pytest.mark.parametrize("share", LANES)
def test_project_files(project, share):
    @settings(max_examples=TABLES // share, **EASY)
    @given(st.one_of(st.binary(max_size=60), JSON.map(_as_toml)))
    def spoilt(content):
        (project.root / "pyproject.toml").write_bytes(content)
        with suppress(WorkbenchError):
            Project.around(project.root)

    spoilt()


def _as_toml(value):
    """A table with a value of any type, as TOML has it for the most part."""
    text = json.dumps(value)
    return f"[tool.workbench]\nproblems = {text}\nresults = {text}\n".encode()


@pytest.mark.parametrize("share", LANES)
def test_words_of_the_command_line(project, share):
    @settings(max_examples=WORDS // share, **EASY)
    @given(st.sampled_from(["run", "show", "list", "results"]), st.text(max_size=12), st.text())
    def spoilt(command, pattern, value):
        words = [command, pattern]
        if command == "run":
            words += ["--set", f"scale={value}"]
        done = CliRunner().invoke(main, words)
        assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
        shutil.rmtree(project.results, ignore_errors=True)

    spoilt()
