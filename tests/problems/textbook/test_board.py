"""A benchmark's controller on a processor, from its named problem to the C in its folder."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest

import workbench as wb

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


@pytest.mark.slow
@pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc, gcc, clang)")
def test_the_code_in_the_results_folder_controls_the_unstable_plant(tmp_path):
    run = wb.run("unstable-first-order/board")
    assert run.holds and run.metrics["order"] == 4
    assert run.metrics["peak"] < 1.2
    (tmp_path / "board.c").write_text(
        '#include "controller.h"\n'
        "static controller_state state;\n"
        "void start(void) { controller_init(&state); }\n"
        "float step(float y) { float u; controller_step(&state, &y, &u); return u; }\n"
    )
    library = tmp_path / "board.so"
    command = [COMPILER, "-std=c99", "-Wall", "-Werror", "-shared", "-fPIC", f"-I{run.path}"]
    subprocess.run([*command, str(tmp_path / "board.c"), "-o", str(library)], check=True)
    code = ctypes.CDLL(str(library))
    code.step.restype, code.step.argtypes = ctypes.c_float, [ctypes.c_float]
    code.start()
    # x' = x + u, held over 0.02 s, u late by half a sample; K acts on -x.
    x, before, trace = 1.0, 0.0, []
    half, h = np.exp(0.01), np.expm1(0.01)
    for _ in range(1000):
        u = code.step(-x)
        x = half * x + h * before
        x = half * x + h * u
        before = u
        trace.append(x)
    assert max(np.abs(trace)) < 2.0
    assert max(np.abs(trace[-100:])) < 0.05
