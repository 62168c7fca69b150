"""The house's `@jit`: kernels, compiled by numba in nopython mode, kept on disk, the same arithmetic with the JIT off.

    kernel(arguments) -> signature -> loaded? -> kept on disk? -> compiled with numba, kept, loaded

numba is imported only where something must be compiled: its import and its own cache take two seconds at every start,
loading machine code some milliseconds. Kernels take and return numbers, arrays and tuples, and raise nothing; one that
allocates an array works, but brings in numba at every start. `NUMBA_DISABLE_JIT=1` runs every kernel as plain Python:
results must not differ.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cached_property
from types import CellType, FunctionType
from typing import Any, TypeVar, cast

from gcodectl.kernels import store
from gcodectl.kernels.fingerprint import fingerprint, named
from gcodectl.kernels.gateway import WORKS
from gcodectl.kernels.native import MisfitError, load
from gcodectl.kernels.signature import slots, spell

Function = TypeVar("Function", bound=Callable[..., object])
Run = Callable[[Sequence[Any]], Any]
"""Machine code, called with what its gateway's slots take."""

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
_LEAN: dict[str, Any] = {"_nrt": False, "no_rewrites": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""No reference counts (three quarters of the time of a short kernel), and no callers but our own."""
_OFF = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
_POLL = 0.05
"""s between looks at what another process is building."""
_LOCK = threading.RLock()


class Kernel:
    """A function that runs as machine code; `py_func` is the function itself."""

    def __init__(self, function: FunctionType, **options: Any) -> None:
        self.py_func = function
        self.__doc__, self.__name__, self.__module__ = function.__doc__, function.__name__, function.__module__
        self._options = {**_OPTIONS, **options}
        self._dispatchers: dict[bool, Any] = {}
        self._loaded: dict[tuple[str, ...], Run | None] = {}
        """By signature; None where numba itself must call it."""
        self._latest: dict[tuple[Any, ...], Run] = {}
        """By the arguments' Python types, which say all but what arrays hold: the gateway looks at that."""

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Run it, compiled for arguments such as these."""
        if named:
            code = self.py_func.__code__
            arguments += tuple(named[name] for name in code.co_varnames[len(arguments) : code.co_argcount])
        kinds, values = slots(arguments)
        if (run := self._latest.get(kinds)) is not None and _watch.wanted is None:
            try:
                return run(values)
            except MisfitError:
                pass  # an array of another kind: what follows finds the kernel for it
        words: list[str] = []
        spell(arguments, words)
        if _watch.wanted is not None:
            return _watch.run(self, " ".join(words), arguments)
        signature = tuple(words)
        if signature not in self._loaded:
            self._loaded[signature] = self._ready(" ".join(words))
        if (run := self._loaded[signature]) is None:
            return self._general(*arguments)
        try:
            result = run(values)
        except MisfitError:  # one that says this machine's byte order in another way than numpy does
            return self._general(*arguments)
        self._latest[kinds] = run
        return result

    @property
    def name(self) -> str:
        """Where the kernel stands: `gcodectl.gcode.parse:parse_kernel`."""
        return f"{self.__module__}:{self.__name__}"

    @cached_property
    def fingerprint(self) -> str:
        """Digest of all that the machine code is made of."""
        return fingerprint(self.py_func, repr(sorted(self._options.items())))

    def dispatcher(self, *, lean: bool) -> Any:
        """Return numba's kernel of this one, and of those it calls; `lean`: without numba's runtime."""
        if lean not in self._dispatchers:
            import numba

            function = self.py_func
            inner = {name: one.dispatcher(lean=lean) for name, one in named(function) if isinstance(one, Kernel)}
            cells = tuple(
                CellType(inner.get(name, cell.cell_contents))
                for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
            )
            bound = FunctionType(
                function.__code__, {**function.__globals__, **inner}, function.__name__, function.__defaults__, cells
            )
            bound.__module__, bound.__qualname__ = function.__module__, function.__qualname__
            made = numba.njit(**{**self._options, **(_LEAN if lean else {})})(bound)
            self._dispatchers[lean] = _once_for_all_constants(made)
        return self._dispatchers[lean]

    def compile(self, signature: str) -> store.Entry:
        """Return the machine code for a signature: as kept, as another process is building it, or compiled now."""
        path = store.path_of(self.name, self.fingerprint, signature)
        while path is not None:
            if (kept := store.read(path)) is not None:
                return kept
            if store.claim(path):
                break
            time.sleep(_POLL)
        try:
            from gcodectl.kernels.build import build

            entry = build(self.dispatcher(lean=True), signature)
            if path is not None:
                store.write(path, entry)
            return entry
        finally:
            if path is not None:
                store.release(path)

    def is_kept(self, signature: str) -> bool:
        """Whether the machine code for a signature is on disk."""
        path = store.path_of(self.name, self.fingerprint, signature)
        return path is not None and path.exists()

    def is_busy(self, signature: str) -> bool:
        """Whether another process is compiling it for a signature."""
        path = store.path_of(self.name, self.fingerprint, signature)
        return path is not None and store.is_busy(path)

    def _ready(self, signature: str) -> Run | None:
        with _LOCK:
            if not WORKS:
                return None
            if not self.is_kept(signature):
                _watch.missing()
            entry = self.compile(signature)
            code = self.py_func.__code__
            return (
                load(entry.machine_code, entry.symbol, signature.split(), entry.returns, code) if entry.symbol else None
            )

    @cached_property
    def _general(self) -> Any:
        """numba's own kernel, kept by numba: for what needs its runtime."""
        made = self.dispatcher(lean=False)
        with suppress(RuntimeError):  # nowhere to write
            made.enable_caching()
        file = getattr(getattr(made, "_cache", None), "_cache_file", None)
        if file is not None:
            file._source_stamp = self.fingerprint
        return made


def _once_for_all_constants(dispatcher: Any) -> Any:
    """Keep numba from compiling a kernel again for every constant that a caller hands it: half of all its work."""
    from numba import types

    template = dispatcher.get_call_template
    plain: Callable[[Any], Any] = types.unliteral

    def of_plain_types(args: Sequence[Any], kws: dict[str, Any]) -> Any:
        return template([plain(one) for one in args], {name: plain(one) for name, one in kws.items()})

    dispatcher.get_call_template = of_plain_types
    return dispatcher


class _Watch:
    """What happens when a kernel is called, or is not there, in a special way."""

    def __init__(self) -> None:
        self.wanted: dict[tuple[str, str], None] | None = None
        self.inside = False
        self.act: Callable[[], None] | None = None

    def run(self, kernel: Kernel, signature: str, arguments: Sequence[Any]) -> Any:
        """Note a kernel that Python calls; run it as plain Python."""
        if self.inside or self.wanted is None:
            return kernel.py_func(*arguments)
        self.wanted[kernel.name, signature] = None
        self.inside = True
        try:
            return kernel.py_func(*arguments)
        finally:
            self.inside = False

    def missing(self) -> None:
        """A kernel is not kept: do once what is to be done then."""
        act, self.act = self.act, None
        if act is not None:
            act()


_watch = _Watch()


def jit(function: Function) -> Function:
    """Compile `function` in nopython mode and keep its machine code; division by zero follows numpy."""
    return function if _OFF else cast(Function, Kernel(cast(FunctionType, function)))


def jit_lean(function: Function) -> Function:
    """Like `jit`, and without reference counts even in callers that need numba's runtime."""
    return function if _OFF else cast(Function, Kernel(cast(FunctionType, function), _nrt=False))


def jit_inline(function: Function) -> Function:
    """Like `jit`, but put into its callers: for a kernel of one or two hot call sites."""
    return function if _OFF else cast(Function, Kernel(cast(FunctionType, function), _nrt=False, forceinline=True))


def when_missing(act: Callable[[], None]) -> None:
    """Call `act` once, if and when a kernel has to be compiled because it is not kept."""
    _watch.act = act


@contextmanager
def noting() -> Iterator[dict[tuple[str, str], None]]:
    """Run kernels as plain Python, and note those that Python calls: (name, signature), in the order of first calls."""
    with _LOCK:
        before, _watch.wanted = _watch.wanted, {}
        try:
            yield _watch.wanted
        finally:
            _watch.wanted = before
