"""How the threads of a sweep wait for one another: numbers that one writes and another reads, in the order of the work."""

from typing import Any

from numba import types
from numba.extending import intrinsic

from ...base.compiled import kernel
from ...base.parallel import Array

SLOTS, LINE = 4, 8  # lines that a part may be ahead of the next one, and numbers in a cache line
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


read: Any = _read
write: Any = _write


@kernel
def await_part(done: Array, part: int, lines: int) -> None:
    """Until a part has done so many lines; a part that does not exist has."""
    if part < 0 or part >= done.shape[0]:
        return
    looks = 0
    while read(done, part) < lines:
        looks += 1
        if looks > PATIENCE:
            give_way()
