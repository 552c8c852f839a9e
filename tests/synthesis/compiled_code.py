"""Exported C code, compiled and called sample by sample."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc, gcc, clang)")


class Compiled:
    """The exported C code, called sample by sample with signals in units."""

    def __init__(self, answer, folder):
        header = answer.export(folder / "board.h", "board")
        kind = "int32_t" if answer.precision == "fixed" else answer.precision
        source = folder / "board.c"
        source.write_text(
            f'#include "{header.name}"\nstatic board_state s;\n'
            f"void start(void) {{ board_init(&s); }}\n"
            f"void step(const {kind} *y, {kind} *u) {{ board_step(&s, y, u); }}\n"
            f"void take(const {kind} *y, const {kind} *u) {{ board_start(&s, y, u); }}\n"
        )
        library = folder / "board.so"
        strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"]
        # An overflow of signed integers, or a shift too wide, ends the program.
        strict += ["-fsanitize=undefined", "-fsanitize-undefined-trap-on-error"]
        subprocess.run(
            [COMPILER, *strict, "-O2", "-shared", "-fPIC", "-o", library, source], check=True
        )
        self.library = ctypes.CDLL(str(library))
        self.type = {"double": np.float64, "float": np.float32, "int32_t": np.int32}[kind]
        form = answer.format
        full = 1.0 if form is None else 2.0 ** (1 - form.signal_bits)
        self.y_unit = 1.0 if form is None else form.y_scale * full
        self.u_unit = 1.0 if form is None else form.u_scale * full
        self.outputs = answer.K.noutputs
        self.library.start()

    def step(self, y):
        given, found = self._in(y, self.y_unit), np.zeros(self.outputs, self.type)
        self.library.step(
            given.ctypes.data_as(ctypes.c_void_p), found.ctypes.data_as(ctypes.c_void_p)
        )
        return found * self.u_unit

    def take(self, y, u):
        one, other = self._in(y, self.y_unit), self._in(u, self.u_unit)
        self.library.take(
            one.ctypes.data_as(ctypes.c_void_p), other.ctypes.data_as(ctypes.c_void_p)
        )

    def _in(self, values, unit):
        scaled = np.asarray(values, float) / unit
        return np.asarray(np.rint(scaled) if self.type is np.int32 else scaled, self.type)
