"""Kernels that only compiled functions can call, called by one that Python can call."""

from functools import cache

import numba


@cache
def called(kernel):
    """The kernel for arguments of Python."""
    return numba.njit(lambda *given: kernel(*given))
