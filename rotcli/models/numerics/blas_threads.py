"""Keep matrix products of a few hundred rows on one thread.

OpenBLAS divides products, factorisations and eigenvalue problems from some 60 rows on among all
cores. At the sizes of this package that saves no time, and on a machine with other work its
waiting threads multiply the CPU time by ten. An environment variable works only before numpy
is imported; OpenBLAS's function works at any time. Other BLAS libraries are left as they are.
"""

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numpy as np

_NAMES = (
    "scipy_openblas_{}_num_threads64_",
    "openblas_{}_num_threads64_",
    "openblas_{}_num_threads",
)


@contextmanager
def one_thread() -> Iterator[None]:
    """Run the body with one OpenBLAS thread; nothing happens with another BLAS."""
    functions = _functions()
    if functions is None:
        yield
        return
    get, set_ = functions
    before = get()
    set_(1)
    try:
        yield
    finally:
        set_(before)


@cache
def _functions() -> tuple[Callable[[], int], Callable[[int], None]] | None:
    """Return OpenBLAS's functions that get and set its number of threads, None without it."""
    home = Path(np.__file__).parents[1]
    for path in sorted(home.glob("numpy.libs/*openblas*")):
        try:
            library = ctypes.CDLL(str(path))
        except OSError:
            continue
        for name in _NAMES:
            get = getattr(library, name.format("get"), None)
            set_ = getattr(library, name.format("set"), None)
            if get is not None and set_ is not None:
                get.restype, set_.argtypes, set_.restype = ctypes.c_int, [ctypes.c_int], None
                return get, set_
    return None
