"""Eight real values, one for each lane, as one number type of compiled code.

They are added, subtracted, multiplied and divided by each other and by floats, as vector
instructions; see `workbench._core.machine_code.sums` for sums of many products.
"""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba.core import extending as _extending
from numba.core.typing import templates as _templates

from workbench._core.machine_code.addresses import cgutils, start_of, types
from workbench._core.machine_code.sums import EIGHT, LANES, load_eight, store_eight

_extend: Any = _extending  # these have no annotations
_typing: Any = _templates
_FREE = ("contract",)
"""Permission for the compiler: a product and a sum may be rounded once, as a fused operation."""


class _Values(types.Type):
    """The type of eight values."""

    def __init__(self) -> None:
        super().__init__(name="eight lanes")


VALUES = _Values()
Values = Any
"""Eight values, in annotations."""


@_extend.register_model(_Values)
class _Model(_extend.models.PrimitiveModel):
    """Representation: eight values are kept in one vector register."""

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, EIGHT)


def _eight(builder: Any, kind: Any, value: Any) -> Any:
    """Eight values, or one float repeated eight times."""
    if kind is VALUES:
        return value
    nothing, zero = ir.Constant(EIGHT, ir.Undefined), ir.Constant(ir.IntType(32), 0)
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(builder.insert_element(nothing, value, zero), nothing, zeros)


def _arithmetic(operation: Any, instruction: str) -> None:
    """Teach an operation to Numba."""

    class Typed(_typing.AbstractTemplate):
        """The types of the operation."""

        def generic(self, args: Any, kws: Any) -> Any:
            if VALUES in args and all(one in (VALUES, types.float64) for one in args):
                return _typing.signature(VALUES, *args)
            return None

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pairs = zip(signature.args, args, strict=True)
        one, other = (_eight(builder, *pair) for pair in pairs)
        return getattr(builder, instruction)(one, other, flags=_FREE)

    _typing.infer_global(operation)(Typed)
    for kinds in ((VALUES, VALUES), (VALUES, types.float64), (types.float64, VALUES)):
        _extend.lower_builtin(operation, *kinds)(generate)


for _names, _instruction in (("add iadd", "fadd"), ("sub isub", "fsub"), ("mul imul", "fmul")):
    for _name in _names.split():
        _arithmetic(getattr(operator, _name), _instruction)
_arithmetic(operator.truediv, "fdiv")


def _eight_of(typing: Any, A: Any, k: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = builder.mul(args[1], ir.Constant(args[1].type, LANES))
        return load_eight(builder, start_of(context, builder, signature.args[0], args[0]), place)

    return VALUES(A, types.intp), generate


def _put(typing: Any, A: Any, k: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = builder.mul(args[1], ir.Constant(args[1].type, LANES))
        target = start_of(context, builder, signature.args[0], args[0])
        store_eight(builder, _eight(builder, signature.args[2], args[2]), target, place)
        return context.get_dummy_value()

    return types.void(A, types.intp, value), generate


def _square_root(typing: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = ir.FunctionType(EIGHT, [EIGHT])
        name = f"llvm.sqrt.v{LANES}f64"
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), args)

    return VALUES(VALUES), generate


def _where_less(typing: Any, a: Any, b: Any, value: Any, other: Any) -> Any:
    kinds = (a, b, value, other)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        one, two, three, four = (
            _eight(builder, kind, arg) for kind, arg in zip(kinds, args, strict=True)
        )
        return builder.select(builder.fcmp_ordered("<", one, two), three, four)

    return VALUES(*kinds), generate


of_lanes: Any = _extend.intrinsic(_eight_of)
"""Read real entry k of an array of lanes: eight values."""
put: Any = _extend.intrinsic(_put)
"""Store eight values, or one float eight times, as real entry k of an array of lanes."""
square_root: Any = _extend.intrinsic(_square_root)
"""Square roots of eight values."""
where_less: Any = _extend.intrinsic(_where_less)
"""In each lane the third argument if the first is less than the second, otherwise the fourth.

Each argument is eight values or a float.
"""
