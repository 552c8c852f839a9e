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
        header = answer.export(folder / "board.h", name="board")
        kind = "int32_t" if answer.precision == "fixed" else answer.precision
        source = folder / "board.c"
        point = None if answer.actuator is None else answer.actuator.point
        r, given = (f"const {kind} *r, ", "r, y, u") if point else ("", "y, u")
        source.write_text(
            f'#include "{header.name}"\nstatic board_state s;\n'
            f"void start(void) {{ board_init(&s); }}\n"
            f"void step({r}const {kind} *y, {kind} *u) {{ board_step(&s, {given}); }}\n"
            f"void take({r}const {kind} *y, const {kind} *u) {{ board_start(&s, {given}); }}\n"
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
        # Counts of fixed point go from the working point.
        counted = point if form else None
        self.y_rest = np.array(counted.y) if counted else 0.0
        self.u_rest = np.array(counted.u) if counted else 0.0
        self.outputs = answer.K.noutputs
        self.library.start()

    def step(self, *signals):
        """The controls for measurements y, or with a working point for set-points r and y."""
        found = np.zeros(self.outputs, self.type)
        given = [self._in(one, self.y_unit, self.y_rest) for one in signals]
        self.library.step(*(one.ctypes.data_as(ctypes.c_void_p) for one in [*given, found]))
        return found * self.u_unit + self.u_rest

    def take(self, *signals):
        """Take over with the last of the signals as controls; the others as for a step."""
        *before, u = signals
        given = [self._in(one, self.y_unit, self.y_rest) for one in before]
        given.append(self._in(u, self.u_unit, self.u_rest))
        self.library.take(*(one.ctypes.data_as(ctypes.c_void_p) for one in given))

    def _in(self, values, unit, rest):
        scaled = np.atleast_1d((np.asarray(values, float) - rest) / unit)
        return np.asarray(np.rint(scaled) if self.type is np.int32 else scaled, self.type)
