"""Processors that this one can play, as data, and the variables that make a process play them."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
BASELINE, AVX2, AVX512 = "baseline", "AVX2", "AVX-512"
"""Vector instructions that NumPy is left with."""


@dataclass(frozen=True)
class Emulation:
    """A processor, or versions of libraries, under which every number must hold."""

    name: str
    blas: str
    """What OPENBLAS_CORETYPE asks for."""
    kernels: frozenset[str]
    """Names under which OpenBLAS may report what it runs then. Builds leave out sets of kernels and
    take the next best for them; such a pair of names stands here, so that nothing else passes."""
    vectors: str
    numba: str
    """LLVM's name of the processor that Numba compiles for."""
    needs: str
    """Feature, in NumPy's words, without which this processor cannot play that one."""
    threads: int = 1
    venv: str = ".venv"


EMULATIONS = {
    one.name: one
    for one in (
        Emulation(
            "oldest", "Haswell", frozenset({"Haswell"}), AVX2, "haswell", "AVX2", 1, ".venv-oldest"
        ),
        # Katmai is the first of the names that OpenBLAS has for its kernels for Prescott.
        Emulation(
            "prescott", "Prescott", frozenset({"Prescott", "Katmai"}), BASELINE, "generic", "SSE3"
        ),
        Emulation(
            "sandybridge", "Sandybridge", frozenset({"Sandybridge"}), BASELINE, "generic", "AVX"
        ),
        # The wheels of NumPy and SciPy give a Zen the kernels for Haswell; others have its own.
        Emulation("zen", "Zen", frozenset({"Zen", "Haswell"}), AVX2, "znver2", "AVX2"),
        Emulation(
            "skylakex", "SkylakeX", frozenset({"SkylakeX"}), AVX512, "skylake-avx512", "AVX512_SKX"
        ),
        Emulation("haswell", "Haswell", frozenset({"Haswell"}), AVX2, "haswell", "AVX2"),
        Emulation(
            "two-threads", "Haswell", frozenset({"Haswell"}), AVX2, "haswell", "AVX2", threads=2
        ),
    )
}
SETTINGS = (
    *("OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES", "NPY_ENABLE_CPU_FEATURES"),
    *("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_CACHE_DIR"),
    *("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "GLIBC_TUNABLES"),
)
"""Variables that an emulation sets, or that would spoil it."""


def disabled(vectors: str, dispatched: list[str]) -> list[str]:
    """Features of NumPy that are switched off, of those that it can switch and this processor has.

    NumPy has had several names for the same instructions: AVX512_SKX is today's X86_V4.
    """
    if vectors == BASELINE:
        return dispatched
    beyond = [name for name in dispatched if name.startswith("AVX512") or name == "X86_V4"]
    return beyond if vectors == AVX2 else []


def plain_environment() -> dict[str, str]:
    """The variables of this process without those that concern processors."""
    return {name: value for name, value in os.environ.items() if name not in SETTINGS}


def environment(emulation: Emulation, dispatched: list[str]) -> dict[str, str]:
    """Variables of a process that plays a processor; features that NumPy can switch off here."""
    settings = {
        "OPENBLAS_CORETYPE": emulation.blas,
        "NUMBA_CPU_NAME": emulation.numba,
        "NUMBA_CPU_FEATURES": "",  # else it adds all that this processor has
        "NUMBA_CACHE_DIR": str(ROOT / emulation.venv / "compiled"),  # for these versions of NumPy
        "OPENBLAS_NUM_THREADS": str(emulation.threads),
        "OMP_NUM_THREADS": str(emulation.threads),
        "PYTHONDONTWRITEBYTECODE": "",
    }
    if emulation.vectors == BASELINE:  # the C library has other functions for it
        settings["GLIBC_TUNABLES"] = "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4"
    if off := disabled(emulation.vectors, dispatched):
        settings["NPY_DISABLE_CPU_FEATURES"] = " ".join(off)
    return plain_environment() | settings
