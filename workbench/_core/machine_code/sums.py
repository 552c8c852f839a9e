"""Arithmetic of eight lanes at once, as vector instructions.

An array of lanes is flat: entry e of a complex matrix has its eight real parts from 16 e on and its
eight imaginary parts after them; entry e of a real array has its eight values from 8 e on. Numba
makes no vector code from loops over lanes, as it cannot know that its arrays do not overlap. That
is why these functions are written in LLVM's language.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core.extending import intrinsic

from workbench._core.machine_code.addresses import cgutils, start_of, types

LANES = 8
"""Number of matrices that are worked on at once."""
Lane = Any
"""An array of lanes, or the address of its first number."""
EIGHT = ir.VectorType(ir.DoubleType(), LANES)


def _vector(builder: Any, data: Any, place: Any) -> Any:
    """Address of the eight values that start at a place."""
    return builder.bitcast(builder.gep(data, [place]), EIGHT.as_pointer())


def load_eight(builder: Any, data: Any, place: Any) -> Any:
    return builder.load(_vector(builder, data, place), align=8)


def store_eight(builder: Any, value: Any, data: Any, place: Any) -> None:
    builder.store(value, _vector(builder, data, place), align=8)


def _number(builder: Any, like: Any, value: int) -> Any:
    """A constant of the type of another number."""
    return ir.Constant(like.type, value)


def _fused(builder: Any, a: Any, b: Any, c: Any) -> Any:
    """a b + c, rounded once."""
    kind = ir.FunctionType(EIGHT, [EIGHT] * 3)
    fused = cgutils.get_or_insert_function(builder.module, kind, f"llvm.fma.v{LANES}f64")
    return builder.call(fused, [a, b, c])


SET, ADD, TAKE = 0, 1, 2
"""Use of a sum: it replaces an entry, is added to it, or is subtracted from it."""


def _summed(
    what: int,
    *,
    complex_: bool = True,
    left: bool = False,
    right: bool = False,
    tile: tuple[int, int] = (1, 1),
) -> Any:
    """Intrinsic that updates a tile of C: each entry by a sum of n products.

    C[c + p c_row + q] and the sum over k of A[a + p a_row + k a_step] B[b + q b_row + k b_step];
    ``left`` and ``right`` conjugate A and B. Larger tiles load less.
    """

    def summed(
        typing: Any,
        C: Any,
        c: Any,
        c_row: Any,
        A: Any,
        a: Any,
        a_row: Any,
        a_step: Any,
        B: Any,
        b: Any,
        b_row: Any,
        b_step: Any,
        n: Any,
    ) -> Any:
        i = types.intp
        signature = types.void(C, i, i, A, i, i, i, B, i, i, i, i)
        rows, columns = tile

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            width = _number(builder, args[1], LANES * (2 if complex_ else 1))
            half = _number(builder, args[1], LANES)
            target, first, second = (
                start_of(context, builder, signature.args[k], args[k]) for k in (0, 3, 7)
            )

            def place(start: Any, *terms: tuple[Any, Any]) -> Any:
                for factor, step in terms:
                    start = builder.add(start, builder.mul(factor, step))
                return builder.mul(start, width)

            def both(data: Any, at: Any) -> list[Any]:
                parts = [load_eight(builder, data, at)]
                return (
                    [*parts, load_eight(builder, data, builder.add(at, half))]
                    if complex_
                    else parts
                )

            entries = [(p, q) for p in range(rows) for q in range(columns)]
            zero = ir.Constant(EIGHT, [0.0] * LANES)
            places, sums = {}, {}
            for p, q in entries:
                row, column = (_number(builder, args[1], k) for k in (p, q))
                at = place(builder.add(args[1], column), (row, args[2]))
                places[p, q] = [at, builder.add(at, half)] if complex_ else [at]
                sums[p, q] = [cgutils.alloca_once(builder, EIGHT) for _ in places[p, q]]
                for total, where in zip(sums[p, q], places[p, q], strict=True):
                    builder.store(
                        zero if what == SET else load_eight(builder, target, where), total
                    )
            with cgutils.for_range(builder, args[11]) as loop:
                k, numbers = loop.index, [_number(builder, args[1], p) for p in range(max(tile))]
                x = [
                    both(first, place(args[4], (numbers[p], args[5]), (k, args[6])))
                    for p in range(rows)
                ]
                y = [
                    both(second, place(args[8], (numbers[q], args[9]), (k, args[10])))
                    for q in range(columns)
                ]
                for p, q in entries:
                    parts = [(0, x[p][0], y[q][0], 1)]
                    if complex_:
                        u, v = (-1 if turned else 1 for turned in (left, right))
                        parts += [
                            (0, x[p][1], y[q][1], -u * v),
                            (1, x[p][0], y[q][1], v),
                            (1, x[p][1], y[q][0], u),
                        ]
                    for part, one, other, sign in parts:
                        one = builder.fneg(one) if (sign < 0) != (what == TAKE) else one
                        total = sums[p, q][part]
                        builder.store(_fused(builder, one, other, builder.load(total)), total)
            for p, q in entries:
                for total, where in zip(sums[p, q], places[p, q], strict=True):
                    store_eight(builder, builder.load(total), target, where)
            return context.get_dummy_value()

        return signature, generate

    return intrinsic(summed)


TILE = 2
"""Rows and columns of a tile."""
set_product: Any = _summed(SET)
"""C[c] = sum over k < n of A[a + k a_step] B[b + k b_step], of complex entries."""
set_product_left: Any = _summed(SET, left=True)
"""As `set_product`, with the conjugates of A."""
set_product_right: Any = _summed(SET, right=True)
"""As `set_product`, with the conjugates of B."""
set_tile: Any = _summed(SET, tile=(TILE, TILE))
"""Compute a tile of C = A B."""
set_tile_right: Any = _summed(SET, right=True, tile=(TILE, TILE))
"""Compute a tile of C = A B^H."""
add_tile_right: Any = _summed(ADD, right=True, tile=(TILE, TILE))
"""Add a tile of A B^H to C."""
add_product_right: Any = _summed(ADD, right=True)
"""Add to C[c] the sum of `set_product`, with the conjugates of B."""
set_tile_left: Any = _summed(SET, left=True, tile=(TILE, TILE))
"""Compute a tile of C = A^H B."""
take_product_left: Any = _summed(TAKE, left=True)
"""Subtract from C[c] the sum of `set_product`, with the conjugates of A."""
take_product_right: Any = _summed(TAKE, right=True)
"""Subtract from C[c] the sum of `set_product`, with the conjugates of B."""
take_tile_right: Any = _summed(TAKE, right=True, tile=(TILE, TILE))
"""Subtract a tile of A B^H from C."""
take_tile_left: Any = _summed(TAKE, left=True, tile=(TILE, TILE))
"""Subtract a tile of A^H B from C."""
set_real_product: Any = _summed(SET, complex_=False)
"""C[c] = sum of products of real entries.

A complex entry counts as two real ones, so this is then the real inner product.
"""
take_real_tile: Any = _summed(TAKE, complex_=False, tile=(TILE, TILE))
"""Subtract a tile of A B^T from C; the entries are real."""
take_real_product: Any = _summed(TAKE, complex_=False)
"""Subtract the sum of `set_real_product` from C[c]."""


def _set_sum(
    typing: Any, C: Any, c: Any, A: Any, a: Any, s: Any, k: Any, B: Any, b: Any, n: Any
) -> Any:
    """C = A + s B for n real entries, which begin at c, a and b; s is entry k of a real array."""
    size = types.intp
    signature = types.void(C, size, A, size, s, size, B, size, size)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        width = _number(builder, args[1], LANES)
        target, first, share, second = (
            start_of(context, builder, signature.args[k], args[k]) for k in (0, 2, 4, 6)
        )
        factor = load_eight(builder, share, builder.mul(args[5], width))
        with cgutils.for_range(builder, args[8]) as loop:
            to, i, j = (builder.mul(builder.add(args[k], loop.index), width) for k in (1, 3, 7))
            found = _fused(
                builder, factor, load_eight(builder, second, j), load_eight(builder, first, i)
            )
            store_eight(builder, found, target, to)
        return context.get_dummy_value()

    return signature, generate


def _scaled(sign: int) -> Any:
    """Intrinsic for C = s A or C = -s A, with n real entries."""

    def scaled(typing: Any, C: Any, c: Any, s: Any, k: Any, A: Any, a: Any, n: Any) -> Any:
        size = types.intp
        signature = types.void(C, size, s, size, A, size, size)

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            width = _number(builder, args[1], LANES)
            target, share, given = (
                start_of(context, builder, signature.args[k], args[k]) for k in (0, 2, 4)
            )
            factor = load_eight(builder, share, builder.mul(args[3], width))
            factor = builder.fneg(factor) if sign < 0 else factor
            with cgutils.for_range(builder, args[6]) as loop:
                to, i = (builder.mul(builder.add(args[k], loop.index), width) for k in (1, 5))
                store_eight(
                    builder, builder.fmul(factor, load_eight(builder, given, i)), target, to
                )
            return context.get_dummy_value()

        return signature, generate

    return intrinsic(scaled)


set_sum: Any = intrinsic(_set_sum)
"""C = A + s B for n real entries, which begin at c, a and b; s is entry k of a real array."""
set_scaled: Any = _scaled(1)
"""C = s A for n real entries, which begin at c and a; s is entry k of a real array."""
set_negative_scaled: Any = _scaled(-1)
"""C = -s A; see `set_scaled`."""
