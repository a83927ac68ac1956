"""How the threads of a sweep wait for one another, by numbers that one writes and another reads in the order of the work; and
how memory is asked for rows before their turn."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ...base.compiled import piece
from ...base.parallel import Array

SLOTS, LINE = 16, 8  # lines that a part may be ahead of the next one, and numbers in a cache line
PATIENCE = 500  # looks at what another thread has done, before its place on a core is offered to others

give_way = types.ExternalFunction("sched_yield", types.int32())


@intrinsic
def _read(context: Any, numbers: Any, i: Any) -> Any:
    """numbers[i, 0], as another thread has written it, and with it all that it had written before."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load_atomic(_place(context, builder, signature, arguments), "acquire", 8)

    return types.int64(numbers, types.intp), code


@intrinsic
def _write(context: Any, numbers: Any, i: Any, value: Any) -> Any:
    """numbers[i, 0] = value, for another thread to see after all that was written before."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store_atomic(arguments[2], _place(context, builder, signature, arguments), "release", 8)
        return context.get_dummy_value()

    return types.void(numbers, types.intp, types.int64), code


def _place(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    numbers = context.make_array(signature.args[0])(context, builder, arguments[0])
    at = builder.mul(arguments[1], arguments[1].type(LINE))
    return builder.gep(numbers.data, [at])


@intrinsic
def _fetch(context: Any, rows: Any, m: Any, i: Any) -> Any:
    """Have what follows rows[m, i] brought near, which need not be there."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        row = builder.mul(arguments[1], builder.extract_value(array.strides, 0))
        byte, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        place = builder.gep(builder.bitcast(array.data, byte), [builder.add(row, builder.mul(arguments[2], row.type(8)))])
        kind = ir.FunctionType(ir.VoidType(), [byte, number, number, number])
        prefetch = builder.module.declare_intrinsic("llvm.prefetch", [byte], kind)
        builder.call(prefetch, [place, number(0), number(2), number(1)])  # to be read, from the second cache, data
        return context.get_dummy_value()

    return types.void(rows, types.intp, types.intp), code


read: Any = _read
write: Any = _write
fetch: Any = _fetch


@piece
def await_part(done: Array, part: int, lines: int) -> None:
    """Until a part has done so many lines; a part that does not exist has."""
    if part < 0 or part >= done.shape[0]:
        return
    looks = 0
    while read(done, part) < lines:
        looks += 1
        if looks > PATIENCE:
            give_way()
