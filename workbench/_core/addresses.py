"""Addresses of numbers in arrays, for compiled functions.

An array is seven numbers to hand over, and its entries are counted from its end where their place
is negative; both cost more than the arithmetic of small functions, and most of their compilation.
An address is one number, and its entries ``a[i]`` are read and written as they are. The arrays must
outlive it, and nothing looks for places outside of them.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import cgutils as _cgutils
from numba.core import types as _types
from numba.core.extending import intrinsic
from numba.np.arrayobj import make_array as _make_array
from numba.np.arrayobj import populate_array as _populate_array

cgutils: Any = _cgutils  # these have no annotations
types: Any = _types
make_array: Any = _make_array
populate_array: Any = _populate_array


def start_of(context: Any, builder: Any, kind: Any, array: Any) -> Any:
    """Address of the first entry of an array, or the address that is given."""
    if isinstance(kind, types.CPointer):
        return array
    return make_array(kind)(context, builder, array).data


def _address(typing: Any, array: Any, place: Any) -> Any:
    signature = types.CPointer(array.dtype)(array, types.intp)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.gep(start_of(context, builder, signature.args[0], args[0]), [args[1]])

    return signature, generate


address: Any = intrinsic(_address)
"""Address of an entry of a contiguous array, by its place in all of it."""


def addresses(kind: Any) -> Any:
    """Intrinsic for a named tuple of addresses in an array, given where each field starts there."""
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
    """Intrinsic for the array of a type at an address, with so many entries."""
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
"""The float array at an address, with so many entries; its owner must outlive it."""
places_at: Any = _vector_at(types.int64)
"""The same of integers."""
