"""The house's `@jit`: numba's nopython mode, cached on disk, the same arithmetic with the JIT off.

`NUMBA_DISABLE_JIT=1` runs every kernel as plain Python: results must not differ.

A cached kernel holds the code of the kernels it calls and the constants it names, but numba looks only at the file that
the kernel stands in. So here a cache is good only while no module of that folder, nor of the folder above, has changed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import event, types

Kernel = TypeVar("Kernel", bound=Callable[..., object])

_OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}
_LEAN: dict[str, Any] = {**_OPTIONS, "_nrt": False}


@lru_cache
def _folder_stamp(folder: Path) -> tuple[tuple[str, int, int], ...]:
    paths = sorted((*folder.glob("*.py"), *folder.parent.glob("*.py")))
    return tuple((str(path), path.stat().st_mtime_ns, path.stat().st_size) for path in paths)


def _compiled(function: Kernel, **options: Any) -> Kernel:
    dispatcher = numba.njit(**options)(function)
    file = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if file is not None:
        file._source_stamp = _folder_stamp(Path(function.__code__.co_filename).parent)
    _take_plain_numbers(dispatcher)
    return cast(Kernel, dispatcher)


def _take_plain_numbers(dispatcher: Any) -> None:
    """Compile once where numba would compile a kernel anew for each number written out in a call: `f(x, 3)`."""
    template_of = getattr(dispatcher, "get_call_template", None)
    if template_of is None:  # the JIT is off
        return

    plain: Callable[[Any], Any] = types.unliteral

    def template_of_plain(args: Sequence[Any], kws: Mapping[str, Any]) -> Any:
        return template_of([plain(arg) for arg in args], {key: plain(kws[key]) for key in kws})

    dispatcher.get_call_template = template_of_plain


def jit(function: Kernel) -> Kernel:
    """Compile `function` in nopython mode with an on-disk cache; division by zero follows numpy."""
    return _compiled(function, **_OPTIONS)


def jit_lean(function: Kernel) -> Kernel:
    """Like `jit`, without reference counts: for hot kernels that allocate no array and return none.

    Counting the references of every array that a call or an inlined kernel names costs more than a short kernel's
    work: three quarters of the time of reading G-code.
    """
    return _compiled(function, **_LEAN)


def jit_inline(function: Kernel) -> Kernel:
    """Like `jit_lean`, but put into its callers: for a kernel of one or two hot call sites."""
    return _compiled(function, **_LEAN, inline="always")


class _Once(event.Listener):
    def __init__(self, say: Callable[[], None]) -> None:
        self.say: Callable[[], None] | None = say

    def on_start(self, _event: Any) -> None:
        say, self.say = self.say, None
        if say is not None:
            say()

    def on_end(self, _event: Any) -> None:
        """Nothing: only the beginning is told."""


def when_compiling(say: Callable[[], None]) -> None:
    """Call `say` once, if and when a kernel has to be compiled because no cache holds it."""
    register: Callable[[str, event.Listener], None] = event.register
    register("numba:compile", _Once(say))
