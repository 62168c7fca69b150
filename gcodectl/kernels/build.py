"""A kernel to machine code, with numba: imported here alone, and only where a kernel is not kept yet."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from gcodectl.kernels import gateway
from gcodectl.kernels.signature import numba_types
from gcodectl.kernels.store import Entry

GENERAL = Entry("", "n", b"")
"""Of a kernel that only numba itself can call."""
_RESOLVED: dict[Any, Any] = {}
"""What numba found that calls of its own functions mean, by their types."""


def build(dispatcher: Any, signature: str) -> Entry:
    """Compile a kernel; GENERAL where it allocates an array or returns one, so that it needs numba's runtime.

    GENERAL too where numba's inner parts, which no version promises, are not what they are here: it is slower, no more.
    """
    try:
        return _build(dispatcher, signature)
    except Exception:  # noqa: BLE001 - a kernel that cannot be compiled at all numba will complain of itself
        return GENERAL


def _build(dispatcher: Any, signature: str) -> Entry:
    from numba.core import compiler as made_typed
    from numba.core.compiler_lock import global_compiler_lock

    compiler: Any = made_typed
    typing, target = dispatcher.targetdescr.typing_context, dispatcher.targetdescr.target_context
    typing.refresh()
    target.refresh()
    flags = compiler.Flags()
    dispatcher.targetdescr.options.parse_as_flags(flags, dispatcher.targetoptions)
    flags.no_compile = True
    types = numba_types(signature.split())
    with global_compiler_lock, _never_run_here(target), _calls_resolved_once(), _nothing_collected():
        with _inner_kernels_unoptimized(target):
            made = compiler.compile_extra(typing, target, dispatcher.py_func, types, None, flags, {})
        made.library.finalize()
    returns = _returns(made.signature.return_type)
    if returns is None or not _stands_alone(made.library):
        return GENERAL
    symbol = _add_gateway(made.library._final_module, made.fndesc.llvm_func_name, signature)
    machine_code = made.library.codegen._tm.emit_object(made.library._final_module)
    return Entry(symbol, returns, machine_code)


def _add_gateway(module: Any, symbol: str, signature: str) -> str:
    """Add a kernel's gateway to its module; returns its symbol."""
    import llvmlite.binding as llvm

    types = [str(one.type) for one in module.get_function(symbol).arguments]
    head = f'target datalayout = "{module.data_layout}"\ntarget triple = "{module.triple}"'
    name = f"gateway_{symbol}"
    module.link_in(llvm.parse_assembly(gateway.source(symbol, name, types, signature.split(), head)))
    return name


@contextmanager
def _inner_kernels_unoptimized(target: Any) -> Iterator[None]:
    """Leave the kernels that one calls as they are: they are optimized, once, as part of it.

    numba would optimize every kernel at every level of the calls.
    """
    with _put_in_place(type(target.codegen().create_library("")), "_optimize_final_module", lambda _: None):
        yield


@contextmanager
def _never_run_here(target: Any) -> Iterator[None]:
    """Make no machine code but the one that is kept: numba would, of every kernel that another one calls."""
    generator = target.codegen()
    library = type(generator.create_library(""))
    target.get_executable = lambda *_: [].append  # stands for a function: hashable, and like no other
    try:
        with (
            _put_in_place(type(generator), "_add_module", lambda *_: None),
            _put_in_place(library, "_finalize_specific", lambda _: None),
        ):
            yield
    finally:
        del target.get_executable


@contextmanager
def _calls_resolved_once() -> Iterator[None]:
    """Look up what `a + b` of two types means once, not at every place: an eighth of all the time."""
    from numba import types as made_typed

    types: Any = made_typed
    resolve = types.Function.get_call_type

    def resolve_once(self: Any, context: Any, args: Any, kws: Any) -> Any:
        call = self, tuple(args), tuple(sorted(kws.items()))
        if call not in _RESOLVED:
            _RESOLVED[call] = resolve(self, context, args, kws)
        return _RESOLVED[call]

    with _put_in_place(types.Function, "get_call_type", resolve_once):
        yield


@contextmanager
def _nothing_collected() -> Iterator[None]:
    """Leave cycles of objects alone for the while: looking for them takes a twelfth of the time, and finds few."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


@contextmanager
def _put_in_place(owner: Any, name: str, other: Any) -> Iterator[None]:
    before = getattr(owner, name)
    setattr(owner, name, other)
    try:
        yield
    finally:
        setattr(owner, name, before)


def _returns(kind: Any) -> Any:
    """Name what a kernel returns; None where it is neither a number nor a tuple of them."""
    from numba import types as made_typed

    types: Any = made_typed
    if isinstance(kind, types.NoneType):
        return "n"
    if isinstance(kind, types.Boolean):
        return "b"
    if isinstance(kind, types.Integer):
        return f"{'i' if kind.signed else 'u'}{kind.bitwidth // 8}"
    if isinstance(kind, types.Float):
        return f"f{kind.bitwidth // 8}"
    if isinstance(kind, types.BaseTuple):
        inner = [_returns(one) for one in kind]
        return None if None in inner else inner
    return None


def _stands_alone(library: Any) -> bool:
    """Tell whether the C library has all that the machine code calls; numba's own helpers are not there without it."""
    outside = (one.name for one in library._final_module.functions if one.is_declaration)
    return not any(name.startswith(("NRT_", "numba_", "Py", "_numba", "__svml")) for name in outside)
