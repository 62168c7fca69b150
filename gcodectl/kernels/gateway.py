"""The gateway of a kernel: one function that takes all arguments in one row of 8-byte slots, one a leaf.

    Python     slots = struct.pack(...)     array: the address of its object | int, bool: itself | float: its bits
    gateway    is every array such as the kernel was compiled for?    no: MISFIT, nothing has happened
               each array's address, shape and strides, read where numpy keeps them  -> the kernel, as numba calls it

ctypes takes a hundred numbers in tens of microseconds, and asking numpy for them in Python takes as long; a kernel that
is called once a chunk of lines so lost a third of its time. An array object begins as numpy's ABI says
(ndarraytypes.h, PyArrayObject_fields and the head of PyArray_Descr, the same in numpy 1 and 2):

    16 data   24 dimensions, how many   32 dimensions   40 strides   56 dtype   64 flags        dtype: 25 char, 26 order
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

MISFIT = 1 << 30
"""Status of a call whose arrays are of other kinds than the kernel was compiled for."""
DATA, NDIM, SHAPE, STRIDES, DTYPE, FLAGS = 16, 24, 32, 40, 56, 64
"""Places in an array object."""
KIND = 25
"""Place in a dtype: its letter, and its byte order behind it."""
CONTIGUOUS = 1


def _peek(kind: Any, address: int) -> int:
    return int(kind.from_address(address).value or 0)


def _lies_as_expected() -> bool:
    """Tell whether numpy keeps what an array is where we look for it."""
    word, size = ctypes.c_int32, ctypes.c_size_t
    array = np.zeros((4, 6), dtype=np.int16)[:, ::2]
    at = id(array)
    if ctypes.sizeof(size) != 8 or object.__basicsize__ != DATA or _peek(word, at + NDIM) != 2:
        return False
    shape, strides = _peek(size, at + SHAPE), _peek(size, at + STRIDES)
    return (  # what can be told without following a pointer first: another layout may have anything there
        _peek(size, at + DATA) == array.__array_interface__["data"][0]
        and _peek(size, at + DTYPE) == id(array.dtype)
        and _peek(word, at + FLAGS) & CONTIGUOUS == 0
        and _peek(word, id(array.base) + FLAGS) & CONTIGUOUS == 1
        and _peek(ctypes.c_uint16, id(array.dtype) + KIND) == letters("h")
        and [_peek(size, shape + 8 * k) for k in range(2)] == [4, 3]
        and [_peek(size, strides + 8 * k) for k in range(2)] == [12, 4]
    )


def letters(char: str) -> int:
    """Return what stands in a dtype of this machine's byte order, by its letter."""
    return ord(char) | ord(np.dtype(char).byteorder) << 8


def leaves(words: Iterable[str]) -> list[str]:
    """Return a signature's words without its tuples' brackets: a word a slot."""
    return [word for word in words if word not in "()"]


def source(symbol: str, gateway: str, types: Sequence[str], words: Iterable[str], head: str) -> str:
    """Return the LLVM assembly of a kernel's gateway.

    `types` are the LLVM types of the kernel's own arguments, those for what it returns and raises first; `head` says
    what machine the module is for.
    """
    typed = any(one.endswith("*") for one in types)  # LLVM 14 and before: pointers say what they point at
    lines: list[str] = []

    def value(operation: str) -> str:
        lines.append(f"  %v{len(lines)} = {operation}")
        return f"%v{len(lines) - 1}"

    def load(kind: str, base: str, offset: int) -> str:
        pointer = f"{kind}*" if typed else "ptr"
        at = value(f"add i64 {base}, {offset}")
        return value(f"load {kind}, {pointer} {value(f'inttoptr i64 {at} to {pointer}')}, align 1")

    kinds = leaves(words)
    slots = [load("double" if word == "f" else "i64", "%slots", 8 * k) for k, word in enumerate(kinds)]
    wrong = "0"
    for word, slot in zip(kinds, slots, strict=True):
        if len(word) > 1:
            dtype = load("i64", slot, DTYPE)
            flags = value(f"and i32 {load('i32', slot, FLAGS)}, {CONTIGUOUS}")
            for found, wanted in (
                (value(f"zext i16 {load('i16', dtype, KIND)} to i32"), letters(word[0])),
                (load("i32", slot, NDIM), int(word[1:-1])),
                (flags, CONTIGUOUS if word[-1] == "C" else 0),
            ):
                wrong = value(f"or i32 {wrong}, {value(f'xor i32 {found}, {wanted}')}")
    lines.append(f"  br i1 {value(f'icmp eq i32 {wrong}, 0')}, label %fits, label %misfit")
    lines.append("misfit:")
    lines.append(f"  ret i32 {MISFIT}")
    lines.append("fits:")
    given = []
    for word, slot in zip(kinds, slots, strict=True):
        if len(word) == 1:
            given.append(slot)
            continue
        shape, strides = load("i64", slot, SHAPE), load("i64", slot, STRIDES)
        lengths = [load("i64", shape, 8 * k) for k in range(int(word[1:-1]))]
        items = "1"
        for length in lengths:
            items = value(f"mul i64 {items}, {length}")
        given += ["0", "0", items, str(np.dtype(word[0]).itemsize), load("i64", slot, DATA), *lengths]
        given += [load("i64", strides, 8 * k) for k in range(len(lengths))]
    arguments = []
    for kind, one in zip(types, ["%result", "%raised", *given], strict=True):
        if kind.endswith("*") or kind == "ptr":
            one = value(f"inttoptr i64 {one} to {kind}")
        elif kind not in ("i64", "double"):  # a bool
            one = value(f"trunc i64 {one} to {kind}")
        arguments.append(f"{kind} {one}")
    status = value(f"call i32 @{symbol}({', '.join(arguments)})")
    body = "\n".join([*lines, f"  ret i32 {status}"])
    declared = f"declare i32 @{symbol}({', '.join(types)})"
    return f"{head}\n{declared}\ndefine i32 @{gateway}(i64 %slots, i64 %result, i64 %raised) {{\n{body}\n}}\n"


WORKS = _lies_as_expected()
"""Whether gateways read arrays right on this machine; where not, numba itself calls kernels."""
