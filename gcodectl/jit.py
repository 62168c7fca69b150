"""The one `@jit` of the house: numba's nopython mode, cached on disk, the same arithmetic with the JIT off.

`NUMBA_DISABLE_JIT=1` runs every kernel as plain Python: results must not differ.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Kernel = TypeVar("Kernel", bound=Callable[..., object])

_LEAN: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}


def jit(function: Kernel) -> Kernel:
    """Compile `function` in nopython mode with an on-disk cache; division by zero follows numpy."""
    return cast(Kernel, numba.njit(cache=True, nogil=True, error_model="numpy")(function))


def jit_lean(function: Kernel) -> Kernel:
    """Like `jit`, without reference counts: for hot kernels that allocate no array and return none.

    Counting the references of every array that a call or an inlined kernel names costs more than a short kernel's
    work: three quarters of the time of reading G-code.
    """
    return cast(Kernel, numba.njit(**_LEAN)(function))


def jit_inline(function: Kernel) -> Kernel:
    """Like `jit_lean`, but put into its callers: for a kernel of one or two hot call sites."""
    return cast(Kernel, numba.njit(**_LEAN, inline="always")(function))
