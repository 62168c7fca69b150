"""What a kernel's machine code depends on, as a digest: its bytecode, and every number and kernel that it names.

    kernel -> code, constants -> numbers, arrays, enums, constants of modules
                              -> kernels -> ...

Machine code made of one fingerprint is good for as long as the fingerprint is the same: whatever file has changed, or
was copied, and whenever. Comments and docstrings do not count.
"""

from __future__ import annotations

import builtins
import hashlib
from collections.abc import Iterator
from enum import Enum
from types import CodeType, FunctionType, ModuleType
from typing import Any, Protocol, runtime_checkable

import numpy as np


@runtime_checkable
class Fingerprinted(Protocol):
    """Something with a fingerprint of its own: another kernel."""

    fingerprint: str


PLAIN = (int, float, str, bytes, tuple, frozenset, type(None), type(Ellipsis), np.generic)


def fingerprint(function: FunctionType, about: str = "") -> str:
    """Return the digest of a kernel's function; TypeError where it names what no kernel can use."""
    digest = hashlib.blake2b(about.encode(), digest_size=16)
    for part in _parts(function):
        digest.update(part)
        digest.update(b"\n")
    return digest.hexdigest()


def named(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """Yield what a function names from outside of it: (name, value), those of its closure too."""
    names = {name for code in _codes(function.__code__) for name in code.co_names}
    for name in sorted(names & set(function.__globals__)):
        yield name, function.__globals__[name]
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        yield name, cell.cell_contents


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yield a function's code, and that of the comprehensions in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _parts(function: FunctionType) -> Iterator[bytes]:
    names: set[str] = set()
    for code in _codes(function.__code__):
        yield code.co_code
        constants = [one for one in code.co_consts if not isinstance(one, CodeType) and one != function.__doc__]
        yield repr((constants, code.co_names, code.co_varnames, function.__defaults__)).encode()
        names.update(code.co_names)
    for name, value in named(function):
        yield name.encode()
        yield from _value_parts(value, names)


def _value_parts(value: Any, names: set[str]) -> Iterator[bytes]:
    if isinstance(value, ModuleType):
        for name in sorted(names & set(vars(value))):
            inner = vars(value)[name]
            if isinstance(inner, (*PLAIN, Fingerprinted, np.ndarray)):
                yield name.encode()
                yield from _value_parts(inner, names)
    elif isinstance(value, Fingerprinted):
        yield value.fingerprint.encode()
    elif isinstance(value, np.ndarray):
        yield repr((value.dtype.str, value.shape)).encode() + value.tobytes()
    elif isinstance(value, type) and issubclass(value, Enum):
        yield repr([(one.name, one.value) for one in value]).encode()
    elif isinstance(value, PLAIN):
        yield repr(value).encode()
    elif not (isinstance(value, type) or getattr(builtins, getattr(value, "__name__", ""), None) is value):
        raise TypeError(f"a kernel names {value!r}, which is no number, array, kernel or module")
