"""Addresses of numbers in arrays, for compiled functions.

Numba hands an array over as seven numbers, and checks for each index whether it is negative and
counts from the end. For small functions both cost more than the arithmetic, and they take most of
the compilation. An address is one number; its entries ``a[i]`` are read and written without such
checks. The array must outlive its address, and an index beyond the array is not noticed.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import cgutils as _cgutils
from numba.core import types as _types
from numba.core.extending import intrinsic
from numba.np.arrayobj import make_array as _make_array
from numba.np.arrayobj import populate_array as _populate_array

cgutils: Any = _cgutils  # Numba's extension functions have no annotations.
types: Any = _types
make_array: Any = _make_array
populate_array: Any = _populate_array


def start_of(context: Any, builder: Any, kind: Any, array: Any) -> Any:
    """Address of the first entry of an array; an address is returned as it is."""
    if isinstance(kind, types.CPointer):
        return array
    return make_array(kind)(context, builder, array).data


def _address(typing: Any, array: Any, place: Any) -> Any:
    signature = types.CPointer(array.dtype)(array, types.intp)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.gep(start_of(context, builder, signature.args[0], args[0]), [args[1]])

    return signature, generate


address: Any = intrinsic(_address)
"""Address of an entry of a contiguous array, given the entry's index in the flattened array."""


def addresses(kind: Any) -> Any:
    """Intrinsic that makes a named tuple of addresses in an array from each field's start index."""
    count = len(kind._fields)

    def found(typing: Any, array: Any, starts: Any) -> Any:
        fields = types.NamedUniTuple(types.CPointer(array.dtype), count, kind)

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            data, places = (start_of(context, builder, signature.args[k], args[k]) for k in (0, 1))
            numbers = [ir.Constant(ir.IntType(64), k) for k in range(count)]
            each = [builder.gep(data, [builder.load(builder.gep(places, [k]))]) for k in numbers]
            return context.make_tuple(builder, signature.return_type, each)

        return fields(array, starts), generate

    return intrinsic(found)


def _vector_at(dtype: Any) -> Any:
    """Intrinsic that views ``count`` entries of the type at an address as an array."""
    kind = types.Array(dtype, 1, "C")

    def found(typing: Any, address: Any, count: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            array = make_array(kind)(context, builder)
            size = context.get_constant(types.intp, 8)
            data = builder.inttoptr(args[0], array.data.type)
            shape, strides = (cgutils.pack_array(builder, [one]) for one in (args[1], size))
            populate_array(array, data, shape, strides, size, meminfo=None)
            return array._getvalue()

        return kind(types.intp, types.intp), generate

    return intrinsic(found)


numbers_at: Any = _vector_at(types.float64)
"""View ``count`` floats at an address as an array; the owner of the memory must outlive it."""
places_at: Any = _vector_at(types.int64)
"""View ``count`` integers at an address as an array, as `numbers_at` does for floats."""
