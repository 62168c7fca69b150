"""Machine code, loaded and called without numba: its import alone takes longer than most files.

A kernel's function has numba's calling convention (numba/core/callconv.py, CPUCallConv), and stands behind a gateway
that takes its arguments in one row of slots (`kernels.gateway`):

    status = gateway(slots, &result, &exception) -> f(&result, &exception, arguments, flattened)

`result` is laid out as C lays out a struct. Kernels raise nothing, so a status other than 0 is our own mistake.
"""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Callable, Sequence
from functools import lru_cache
from types import CodeType
from typing import Any

import llvmlite.binding as llvm

from gcodectl.kernels.gateway import MISFIT, leaves

_NUMBERS: dict[str, Any] = {
    "b": ctypes.c_bool, "i1": ctypes.c_int8, "i2": ctypes.c_int16, "i4": ctypes.c_int32, "i8": ctypes.c_int64,
    "u1": ctypes.c_uint8, "u2": ctypes.c_uint16, "u4": ctypes.c_uint32, "u8": ctypes.c_uint64,
    "f4": ctypes.c_float, "f8": ctypes.c_double, "n": ctypes.c_void_p,
}  # fmt: skip
"""Results by name: `n` is None."""
_SLOTS = {"i": "q", "f": "d", "b": "?7x"}
"""Numbers in a gateway's slots, by their words; an array is the address of its object."""
_OKAY = 0

Returns = Any
"""Of a kernel: a name in _NUMBERS, or a list of them."""


class MisfitError(Exception):
    """An array is of another kind than the kernel was compiled for; nothing has been done."""


@lru_cache
def engine() -> Any:
    """Return the engine that all machine code is loaded into; it lives as long as the program."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_default_triple().create_target_machine()
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), target)


@lru_cache
def processor() -> str:
    """Name the processor that machine code is made for."""
    return f"{llvm.get_process_triple()} {llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"


def load(
    machine_code: bytes, symbol: str, words: Sequence[str], returns: Returns, source: CodeType
) -> Callable[[Sequence[Any]], Any]:
    """Load a kernel's machine code; returns what calls its gateway with slots' values, `words` being its signature.

    That raises MisfitError where an array is of another kind. It bears the name of its `source`, for profilers and
    tracebacks.
    """
    engine().add_object_file(llvm.ObjectFileRef.from_data(machine_code))
    engine().finalize_object()
    address = engine().get_function_address(symbol)
    assert address, f"there is no {symbol} in its machine code"
    pointer = ctypes.c_void_p
    call = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_char_p, pointer, pointer)(address)
    pack = struct.Struct("=" + "".join(_SLOTS.get(word, "Q") for word in leaves(words))).pack
    result_type, simple = _result_type(returns), isinstance(returns, str)

    def run(values: Sequence[Any]) -> Any:
        result, exception = result_type(), pointer()
        status = call(pack(*values), ctypes.byref(result), ctypes.byref(exception))
        if status != _OKAY:
            if status == MISFIT:
                raise MisfitError
            raise RuntimeError(f"a kernel ended with status {status}: {symbol}")
        return result.value if simple else _unpacked(result)

    run.__code__ = run.__code__.replace(
        co_name=source.co_name, co_filename=source.co_filename, co_firstlineno=source.co_firstlineno
    )
    return run


def _result_type(returns: Returns) -> Any:
    if isinstance(returns, str):
        return _NUMBERS[returns]
    fields = [(f"f{k}", _result_type(one)) for k, one in enumerate(returns)]
    return type("Result", (ctypes.Structure,), {"_fields_": fields})


def _unpacked(result: Any) -> tuple[Any, ...]:
    values = (getattr(result, name) for name, *_ in result._fields_)
    return tuple(_unpacked(one) if isinstance(one, ctypes.Structure) else one for one in values)
