"""What is read of a folder that somebody else has made: its own files, within bounds."""

import json
import os
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import workbench as wb
from workbench.bench.formats import netcdf
from workbench.bench.results import Run
from workbench.bench.store import damage, seal
from workbench.bench.trust.untrusted import (
    DEEPEST,
    LARGEST_TEXT,
    file_stem,
    problem_name,
    question_key,
    read_json,
)
from workbench.errors import ResultError

VALUES = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=20,
)


@pytest.fixture
def run(project):
    return wb.run("toy/root")


# --- links ------------------------------------------------------------------------------------


@pytest.mark.cases(2)
@pytest.mark.skipif(os.name == "nt", reason="links need rights on Windows")
@pytest.mark.parametrize("name", ["run.json", "data.nc", "certificate.json", "log.txt", "more"])
def test_a_link_is_refused(run, tmp_path, name):
    elsewhere = tmp_path / "elsewhere"
    file = run.path / name
    elsewhere.write_bytes(file.read_bytes() if file.exists() else b"secret")
    file.unlink(missing_ok=True)
    file.symlink_to(elsewhere)
    if name != "more":
        assert any(f"{name} in" in text and "is a link" in text for text in damage(run.path))
    found = wb.verify(run.path)
    assert not found.holds and "secret" not in repr(found)


@pytest.mark.skipif(os.name == "nt", reason="links need rights on Windows")
def test_a_loop_of_links_ends(run):
    (run.path / "loop").symlink_to(run.path)
    assert not wb.verify(run.path).holds


@pytest.mark.parametrize("kind", ["external", "soft", "virtual", "group", "elsewhere"])
def test_arrays_of_other_files_are_refused(tmp_path, kind):
    file, other = tmp_path / "data.nc", tmp_path / "other.h5"
    with h5py.File(other, "w") as raw:
        raw["secret"] = np.arange(3.0)
    with h5py.File(file, "w") as raw:
        if kind == "external":
            raw["x"] = h5py.ExternalLink(str(other), "secret")
        elif kind == "soft":
            raw["x"] = h5py.SoftLink("/nowhere")
        elif kind == "virtual":
            layout = h5py.VirtualLayout(shape=(3,), dtype=float)
            layout[:] = h5py.VirtualSource(str(other), "secret", shape=(3,))
            raw.create_virtual_dataset("x", layout)
        elif kind == "group":
            raw.create_group("x")
        else:
            raw.create_dataset("x", (3,), float, external=[(str(other), 0, 24)])
    with pytest.raises(ResultError, match=r"data\.nc: x "):
        netcdf.read(file)


# --- size and depth ---------------------------------------------------------------------------


def test_two_kilobytes_that_unpack_to_gigabytes_are_refused(tmp_path):
    file = tmp_path / "data.nc"
    with h5py.File(file, "w") as raw:
        raw.create_dataset("x", (400_000_000,), float, chunks=(1_000_000,), compression="gzip")
    assert file.stat().st_size < 10_000
    with pytest.raises(ResultError, match=r"would unpack to 3200000000"):
        netcdf.read(file)


def test_brackets_nested_a_hundred_thousand_deep_are_refused(tmp_path):
    file = tmp_path / "run.json"
    for text in ("[" * 100_000 + "]" * 100_000, "[" * (DEEPEST + 1), '{"a":' * 5000):
        file.write_text(text)
        with pytest.raises(ResultError, match=f"nested more than {DEEPEST} deep"):
            read_json(file)
    file.write_text(json.dumps(["[" * 1000, '\\"' * 9, "{"]))  # within texts they mean nothing
    assert read_json(file)[0] == "[" * 1000


def test_a_huge_file_is_not_read(tmp_path):
    file = tmp_path / "run.json"
    with file.open("wb") as raw:
        raw.truncate(LARGEST_TEXT + 1)
    with pytest.raises(ResultError, match=r"read are at most"):
        read_json(file)


@given(VALUES)
def test_what_json_writes_is_read(value):
    folder = Path(os.environ["PYTEST_TMP_JSON"])
    (folder / "a.json").write_text(json.dumps(value), encoding="utf-8")
    assert read_json(folder / "a.json") == json.loads(json.dumps(value))


@pytest.fixture(autouse=True, scope="module")
def _folder(tmp_path_factory):
    os.environ["PYTEST_TMP_JSON"] = str(tmp_path_factory.mktemp("json"))
    yield
    del os.environ["PYTEST_TMP_JSON"]


# --- names ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["", "/etc", "..", "a/../b", "a//b", "a/", "\0", "a\nb", 3, None])
def test_no_name_leads_out_of_the_folder(name):
    for check in (problem_name, question_key):
        with pytest.raises(ResultError):
            check(name)
    if isinstance(name, str):
        with pytest.raises(ResultError):
            file_stem(name)


@pytest.mark.cases(0)
@given(st.text())
def test_a_name_that_is_let_through_stays_below(name):
    for check in (problem_name, question_key, file_stem):
        try:
            check(name)
        except ResultError:
            continue
        below = Path("/root-of-it") / name
        assert Path(os.path.normpath(below)) == below and below != Path("/root-of-it")


@pytest.mark.parametrize("call", [wb.verify, wb.open_run, wb.report])
@pytest.mark.parametrize("path", ["a\0b", "\ud800"])
def test_a_path_that_none_can_be_is_refused(project, call, path):
    with pytest.raises(ResultError, match=r"cannot be a path|no results folder|cannot write"):
        call(path)


# --- formats ----------------------------------------------------------------------------------


def test_a_newer_format_is_refused_politely(run):
    info = json.loads((run.path / "run.json").read_text())
    (run.path / "run.json").write_text(json.dumps(info | {"format": 3}))
    seal(run.path)
    with pytest.raises(ResultError, match="format 3, of a newer workbench; this one reads up to 2"):
        _ = wb.open_run(run.path).info
    assert "format 3" in repr(wb.verify(run.path))
    assert "format 3" in repr(Run(run.path))


@given(VALUES)
def test_any_run_json_is_read_or_refused(value):
    folder = Path(os.environ["PYTEST_TMP_JSON"])
    for name in ("run", "certificate", "metrics"):
        (folder / f"{name}.json").write_text(json.dumps(value), encoding="utf-8")
    for part in ("info", "certificate", "metrics"):
        try:
            getattr(Run(folder), part)
        except ResultError:
            continue


def test_a_notebook_shows_words_as_words(run):
    info = json.loads((run.path / "run.json").read_text())
    (run.path / "run.json").write_text(json.dumps(info | {"method": "<script>x</script>"}))
    assert "<script>" not in Run(run.path)._repr_html_()
