"""Loops that cannot be array arithmetic: compiled by numba where it is installed, the same Python where it is not."""

import sys
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar, cast

Kernel = TypeVar("Kernel", bound=Callable)
FAST: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract", "nsz"}, "nogil": True}


@cache
def has_numba() -> bool:
    """Whether numba is installed."""
    return find_spec("numba") is not None


@cache
def compiled(kernel: Kernel) -> Kernel:
    """The kernel in machine code, or itself if numba is not installed: the arithmetic, and so the result, is the same.

    numba is imported at the first call, not with the package. Machine code is kept between runs beside the kernel's file
    or in the user's cache directory; where neither can be written it is made anew in each run.
    """
    return _machine_code(kernel)


def kernel(function: Kernel) -> Kernel:
    """`compiled` as a decorator, for modules whose kernels call one another and which are imported when they are needed.

    Division by zero gives inf or NaN, as in NumPy, and products may be added without rounding in between: loops like these
    are only then turned into vector instructions.
    """
    return _machine_code(function, **FAST)


def piece(function: Kernel) -> Kernel:
    """A `kernel` that kernels call, which becomes a part of each.

    Left on its own it would have a copy in every caller's machine code, compiled in other surroundings, where other products
    are added without rounding; a process takes the copy that it loads first for all callers: last bits would depend on which
    loops it used before, and on whether it compiled them or found them in the cache.
    """
    return _machine_code(function, forceinline=True, **FAST)


def _machine_code(function: Kernel, **how: Any) -> Kernel:
    try:
        from numba import njit
    except ImportError:
        return function
    _announce()
    try:
        made = njit(cache=True, **how)(function)
    except RuntimeError:  # numba found no directory for its cache
        return cast(Kernel, njit(**how)(function))
    # numba's own stamp is of the kernel's file: code made before another file changed, by an upgrade in place, would be taken.
    file = made._cache._cache_file
    file._source_stamp = file._source_stamp, _stamp(function)
    return cast(Kernel, made)


def _stamp(function: Callable) -> tuple[Any, ...]:
    """What a kernel's machine code depends on besides its own file: constants, and pieces from other files."""
    parts = list[Any]()
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, int | float | str | tuple):
            parts.append(value)
        elif inner := getattr(value, "py_func", None):
            parts.append((_text(inner.__code__.co_filename), _stamp(inner)))
    return tuple(parts)


@cache
def _text(path: str) -> str:
    """A file's hash."""
    return sha256(Path(path).read_bytes()).hexdigest()


@cache
def _announce() -> None:
    """Print a line on a terminal at the first loop that is compiled as no cache has it: some 20 s, once an installation."""
    from numba.core import event

    class Told(event.Listener):
        yet = False

        def on_start(self, event: Any) -> None:
            if not self.yet and sys.stderr.isatty():
                print("lcp-lube: loops are compiled, once for this installation; about 20 s", file=sys.stderr, flush=True)
            self.yet = True

        def on_end(self, event: Any) -> None:
            """Nothing more."""

    event.register("numba:compile", Told())
