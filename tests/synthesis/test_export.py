"""Controllers in files: what comes back, and what a C compiler makes of them."""

import json
import shutil
import subprocess

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from workbench.plants.cd_drive.drive import plants as drives

import workbench as wb
from workbench.errors import InputError, ResultError
from workbench.simulation import respond
from workbench.solution import solve
from workbench.synthesis import discretise, export, load_controller, second_order_sections

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc, gcc, clang)")

MAIN = """\
#include <stdio.h>
#include "{name}.h"

int main(void)
{{
    {name}_state state;
    {name}_real y[{guard}_INPUTS], u[{guard}_OUTPUTS];
    double value;
    {name}_init(&state);
    for (;;) {{
        for (int j = 0; j < {guard}_INPUTS; j++) {{
            if (scanf("%la", &value) != 1)
                return 0;
            y[j] = ({name}_real)value;
        }}
        {name}_step(&state, y, u);
        for (int i = 0; i < {guard}_OUTPUTS; i++)
            printf("%a\\n", (double)u[i]);
    }}
}}
"""


def system(states=3, inputs=2, outputs=2, dt=0.01, seed=0):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(states, states))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max(initial=0.1)
    return control.ss(
        A,
        rng.normal(size=(states, inputs)),
        rng.normal(size=(outputs, states)),
        rng.normal(size=(outputs, inputs)),
        dt,
        remove_useless_states=False,
    )


def computed(folder, inputs, outputs, name="controller"):
    """Outputs (N, outputs) of the compiled header, exactly."""
    (folder / "main.c").write_text(MAIN.format(name=name, guard=name.upper()))
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"]
    command = [COMPILER, *strict, "-O2", "-o", folder / "main", folder / "main.c"]
    subprocess.run(command, check=True)
    text = "\n".join(float(value).hex() for value in np.ravel(inputs))
    done = subprocess.run([folder / "main"], input=text, capture_output=True, text=True, check=True)
    return np.array([float.fromhex(word) for word in done.stdout.split()]).reshape(-1, outputs)


# --- files that are read back -----------------------------------------------------------------


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 4), st.integers(1, 3), st.integers(1, 3), st.integers(0, 1000),
    st.sampled_from([0, None, True, 0.1, 1 / 35e3]), st.sampled_from(["json", "mat"]),
)  # fmt: skip
def test_everything_comes_back(tmp_path_factory, n, m, p, seed, dt, format):
    K = system(n, m, p, dt, seed)
    K = control.ss(
        K, inputs=[f"y {j}" for j in range(m)], outputs=[f"ü{i}" for i in range(p)], name="K"
    )
    about = {"drive": "ψ", "gains": [1.5, None, True], "nested": {"made": 2026}}
    path = export(K, tmp_path_factory.mktemp("out") / "file", format, metadata=about)
    back, metadata = load_controller(path)
    for key in "ABCD":
        assert np.array_equal(getattr(back, key), getattr(K, key))
    assert back.dt is K.dt if dt in (None, True) else back.dt == K.dt
    assert (back.input_labels, back.output_labels) == (K.input_labels, K.output_labels)
    assert (back.state_labels, back.name) == (K.state_labels, K.name)
    assert metadata == about


def test_numbers_of_any_size_come_back(tmp_path):
    values = [5e-324, -0.0, 1.7976931348623157e308, np.nextafter(1, 2), 0.1 + 0.2]
    K = control.ss([], [], [], [values])
    for format in ("json", "mat"):
        back, _ = load_controller(export(K, tmp_path / "k", format))
        assert back.D.tobytes() == K.D.tobytes()


def test_others_can_read_the_files(tmp_path):
    from scipy.io import loadmat

    K = system()
    assert np.array_equal(loadmat(export(K, tmp_path / "k.mat", "mat"))["A"], K.A)
    assert loadmat(tmp_path / "k.mat")["dt"].item() == 0.01
    assert json.loads(export(K, tmp_path / "k.json", "json").read_text())["dt"] == 0.01


def test_a_file_that_was_cut_or_changed_is_refused(tmp_path):
    for format in ("json", "mat"):
        path = export(system(), tmp_path / format, format)
        content = path.read_bytes()
        for size in range(0, len(content) - 1, 97):
            path.write_bytes(content[:size])
            with pytest.raises(ResultError, match="holds no controller"):
                load_controller(path)
    stored = json.loads(export(system(), path, "json").read_text())
    stored["B"] = {"shape": [2, 2], "data": [1, 2, 3, 4]}
    path.write_text(json.dumps(stored))
    with pytest.raises(ResultError, match="holds no controller"):
        load_controller(path)


@pytest.mark.parametrize("content", [b"", b"{}", b"{", b"nothing", b'{"kind": "other"}'])
def test_what_is_no_controller_is_refused(tmp_path, content):
    path = tmp_path / "file"
    path.write_bytes(content)
    with pytest.raises(ResultError, match="holds no controller"):
        load_controller(path)
    with pytest.raises(ResultError, match="holds no controller"):
        load_controller(tmp_path / "missing")


# --- C ----------------------------------------------------------------------------------------


@needs_compiler
@pytest.mark.parametrize(("n", "m", "p"), [(0, 1, 2), (1, 1, 1), (5, 2, 3), (12, 3, 1)])
def test_the_compiled_header_gives_the_samples(tmp_path, n, m, p):
    K = system(n, m, p, seed=n)
    export(K, tmp_path / "controller.h", "c")
    y = np.random.default_rng(1).normal(size=(500, m))
    expected = respond(K, y)
    error = np.abs(computed(tmp_path, y, p) - expected).max()
    assert error <= 1e-12 * np.abs(expected).max()
    _, theirs = control.forced_response(K, np.arange(500) * K.dt, y.T, squeeze=False)
    assert np.abs(theirs.T - expected).max() <= 1e-12 * np.abs(expected).max()


@needs_compiler
def test_compiled_sections_give_the_samples(tmp_path):
    sections = second_order_sections(system(5, 2, 2, seed=3))
    export(sections, tmp_path / "controller.h", "c")
    y = np.random.default_rng(1).normal(size=(500, 2))
    expected = respond(sections.system, y)
    assert np.abs(computed(tmp_path, y, 2) - expected).max() <= 1e-12 * np.abs(expected).max()


@needs_compiler
def test_the_focus_controller_in_single_precision(tmp_path):
    K = discretise(drives.controller("focus"), 1 / 35e3)
    export(K, tmp_path / "focus.h", "c", name="focus", precision="float")
    y = np.random.default_rng(1).normal(size=(500, 1))
    expected, found = respond(K, y), computed(tmp_path, y, 1, "focus")
    error = np.abs(found - expected).max() / np.abs(expected).max()
    assert 1e-9 < error < 1e-4


@needs_compiler
def test_limits_clip_outputs_of_sections_and_nothing_else(tmp_path):
    K = second_order_sections(system(4, 1, 2, seed=5))
    export(K, tmp_path / "controller.h", "c", limits=([-0.5, -2.0], [1.0, 0.3]))
    y = np.random.default_rng(1).normal(size=(300, 1))
    expected = np.clip(respond(K.system, y), [-0.5, -2.0], [1.0, 0.3])
    found = computed(tmp_path, y, 2)
    assert np.abs(found - expected).max() <= 1e-12
    assert {-0.5, 1.0} <= set(found[:, 0])


# --- bad input, and interruptions -------------------------------------------------------------


@pytest.mark.parametrize(
    ("format", "change", "words"),
    [
        ("xml", {}, "'xml'.*json, mat, c"),
        (
            "c",
            {"controller": control.ss(-1, 1, 1, 0, name="lead")},
            "'lead' has dt = 0.*discretised",
        ),
        ("c", {"controller": control.ss(0.5, 1, 1, 0, True)}, "dt = True"),
        (
            "c",
            {"controller": control.ss(1e300, 1, 1, 0, 1), "precision": "float"},
            "float cannot hold",
        ),
        (
            "c",
            {"controller": control.ss(1e-60, 1, 1, 0, 1), "precision": "float"},
            "float cannot hold",
        ),
        ("c", {"precision": "half"}, "'half'"),
        ("c", {"name": "2nd"}, "C identifier"),
        ("c", {"name": "a b"}, "C identifier"),
        ("c", {"limits": ([0.0], [1.0])}, "2 outputs"),
        ("c", {"limits": ([0.0, 1.0], [1.0, 1.0])}, "lowest below its highest"),
        ("c", {"limits": ([0.0, 1.0], [1.0, np.inf])}, "finite"),
        ("c", {"metadata": {"a": 1}}, "no metadata"),
        ("json", {"limits": ([0.0, 0.0], [1.0, 1.0])}, "for C"),
        ("json", {"metadata": {"a": object()}}, "metadata"),
        ("mat", {"metadata": {1: 2}}, "metadata"),
        ("json", {"metadata": {"a": float("nan")}}, "metadata"),
        ("json", {"controller": control.ss(np.nan, 1, 1, 0)}, "A of K .* not finite"),
    ],
)
def test_bad_input_is_named_and_writes_nothing(tmp_path, format, change, words):
    given = {"controller": system(), "path": tmp_path / "out", "format": format} | change
    with pytest.raises(InputError, match=words):
        export(**given)
    assert not list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written(tmp_path):
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "missing" / "k.json", tmp_path / "folder"):
        with pytest.raises(InputError, match=f"{path} cannot be written"):
            export(system(), path, "json")
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_an_interrupted_write_leaves_the_older_file(tmp_path, monkeypatch, error):
    path = export(system(seed=1), tmp_path / "k.json", "json")
    before = path.read_bytes()

    def fails(descriptor):
        raise error

    monkeypatch.setattr("os.fsync", fails)
    with pytest.raises(InputError if isinstance(error, OSError) else KeyboardInterrupt):
        export(system(seed=2), path, "json")
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
    monkeypatch.undo()
    export(system(seed=2), path, "json")
    assert path.read_bytes() != before


# --- what is no controller --------------------------------------------------------------------


@needs_compiler
def test_a_kalman_filter(tmp_path):
    """The estimate of a position and a speed from the force and a noisy position."""
    A, B, C = np.array([[1.0, 0.01], [-0.01, 0.998]]), np.array([[0.0], [0.01]]), [[1.0, 0.0]]
    L, _, _ = control.dlqe(A, np.eye(2), C, 0.01 * np.eye(2), [[0.1]])
    estimator = control.ss(A - L @ C, np.hstack([B, L]), np.eye(2), 0, 0.01)
    export(estimator, tmp_path / "controller.h", "c")
    given = np.random.default_rng(3).normal(size=(200, 2))
    expected = control.forced_response(estimator, None, given.T).outputs
    np.testing.assert_allclose(computed(tmp_path, given, 2).T, expected, atol=1e-12)


@pytest.mark.cases(0)
@needs_compiler
def test_a_fault_filter_and_a_cascade(tmp_path):
    """A certified answer is exported as it is; parts in series are one system."""
    found = solve(wb.load("quick/lag/fault-filter"))
    sampled = discretise(found, 1e-3)
    low_pass = discretise(control.tf(1, [0.01, 1]), 1e-3)
    export(low_pass * sampled, tmp_path / "controller.h", "c")
    given = np.random.default_rng(4).normal(size=(300, sampled.ninputs))
    expected = control.forced_response(low_pass * sampled, None, given.T).outputs.reshape(-1)
    np.testing.assert_allclose(computed(tmp_path, given, 1).ravel(), expected, atol=1e-9)
