"""Calls of compiled functions by their addresses, so that one compiled loop serves all of them.

Numba's own function pointers are looked up again at every call of the loop, which takes as long as
hundreds of samples.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from numba.core.extending import intrinsic

from workbench._core.machine_code.addresses import cgutils, types

VECTOR = types.Array(types.float64, 1, "C")


@cache
def address_of(function: Any, arguments: int) -> int:
    """Address of a compiled function that takes `arguments` float arrays.

    The caller must keep the function in memory.
    """
    function.compile(types.void(*[VECTOR] * arguments))
    (made,) = (one for key, one in function.overloads.items() if key == (VECTOR,) * arguments)
    found: int = made.library.get_pointer_to_function(made.fndesc.llvm_func_name)
    return found


def _call(address: Any, arrays: tuple[Any, ...]) -> Any:
    signature = types.void(types.int64, *arrays)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        convention, given = context.call_conv, signature.args[1:]
        kind = convention.get_function_type(types.none, given)
        function = builder.inttoptr(args[0], kind.as_pointer())
        status, _ = convention.call_function(builder, function, types.none, given, args[1:])
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return context.get_dummy_value()

    return signature, generate


def _call3(typing: Any, address: Any, a: Any, b: Any, c: Any) -> Any:
    return _call(address, (a, b, c))


def _call4(typing: Any, address: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    return _call(address, (a, b, c, d))


call3: Any = intrinsic(_call3)
"""Call the function of three float arrays at an address."""
call4: Any = intrinsic(_call4)
"""Call the function of four float arrays at an address."""
