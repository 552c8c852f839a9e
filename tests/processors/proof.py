"""What a process really runs on: asked of NumPy, OpenBLAS, Numba's compiler and the C library.

`python proof.py` prints it, and what is installed; `python proof.py NAME NATIVE` fails where it is
not what the emulation of that name asks for. NATIVE are values of the C library without it.
"""

from __future__ import annotations

import importlib
import json
import math
import sys
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

from emulations import BASELINE, EMULATIONS, Emulation, disabled

LIBRARIES = ("numpy", "scipy.linalg", "slycot", "scs")
"""Modules that bring an OpenBLAS of their own. CasADi's has the kernels of one processor only."""
MULTITHREADED = ("numpy.libs", "scipy.libs")


def observed() -> dict[str, Any]:
    """Kernels and threads of each OpenBLAS, features of NumPy, target of Numba, values of libm."""
    for name in LIBRARIES:
        importlib.import_module(name)
    from numba.core.registry import cpu_target
    from numpy._core import _multiarray_umath as numpy
    from threadpoolctl import threadpool_info

    blas = {
        Path(one["filepath"]).parent.name: (one["architecture"], one["num_threads"])
        for one in threadpool_info()
        if one["internal_api"] == "openblas"
    }
    has = numpy.__cpu_features__
    _, target, features = cpu_target.target_context.codegen().magic_tuple()
    return {
        "blas": dict(sorted(blas.items())),
        "dispatched": [name for name in numpy.__cpu_dispatch__ if has[name]],
        "features": sorted(name for name in has if has[name]),
        "libm": str(hash(tuple(math.exp(k / 7) for k in range(4000)))),
        "numba": (target, features),
    }


def differences(emulation: Emulation, found: dict[str, Any], native: str) -> list[str]:
    """What is otherwise than the emulation asks for, in words."""
    wrong = []
    if not found["blas"].keys() >= set(MULTITHREADED):
        wrong.append(f"OpenBLAS of {', '.join(MULTITHREADED)} is needed, found {found['blas']}")
    for library, (kernels, threads) in found["blas"].items():
        if kernels not in emulation.kernels:
            wrong.append(f"OpenBLAS of {library} runs {kernels}, not {emulation.blas}")
        if threads != emulation.threads and library in MULTITHREADED:
            wrong.append(f"OpenBLAS of {library} has {threads} threads, not {emulation.threads}")
    if left := disabled(emulation.vectors, found["dispatched"]):
        wrong.append(f"NumPy still uses {' '.join(left)}")
    if emulation.needs not in found["features"]:
        wrong.append(f"this processor lacks {emulation.needs}")
    if emulation.vectors == BASELINE and "FMA3" in found["features"] and found["libm"] == native:
        wrong.append("the C library still uses FMA")
    if tuple(found["numba"]) != (emulation.numba, ""):
        target, features = found["numba"]
        wrong.append(f"Numba compiles for {target} {features}, not for {emulation.numba} alone")
    return wrong


if __name__ == "__main__":
    seen = observed()
    if len(sys.argv) > 1:
        name, native = sys.argv[1:]
        if wrong := differences(EMULATIONS[name], seen, native):
            sys.exit(f"The emulation {name} is not in effect:\n" + "\n".join(wrong))
    versions = {one.metadata["Name"]: one.version for one in distributions()}
    print(json.dumps(seen | {"python": sys.version, "versions": dict(sorted(versions.items()))}))
