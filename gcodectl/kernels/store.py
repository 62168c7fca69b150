"""Where machine code is kept: one file a kernel and signature, named by its fingerprint, whole or not there at all.

    <folder>/<kernel>-<place>-<fingerprint>.o      place: digest of signature, processor, Python, numba
    <folder>/<kernel>-<place>-<fingerprint>.busy   somebody builds it now: its process id

The folder is beside the package (`__pycache__/kernels`), or where that cannot be written the user's own cache; with
NUMBA_CACHE_DIR, there. Where nothing can be written nothing is kept.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from gcodectl.kernels.native import processor

FORMAT = 2
LONGEST = 120.0
"""s that building one kernel takes at most; an older claim is nobody's, whoever has its process id by now."""
_CHECK = 16
"""Bytes of the digest that an entry begins with."""


class Entry(NamedTuple):
    """What is kept: machine code (none where the kernel needs numba's runtime), its function and what it returns."""

    symbol: str
    returns: Any
    machine_code: bytes


@lru_cache
def folder() -> Path | None:
    """Return the folder that machine code is kept in; None where none can be written."""
    return next((one for one in _places() if _usable(one)), None)


def _places() -> Iterator[Path]:
    package = Path(__file__).resolve().parent.parent
    ours = f"kernels-{hashlib.blake2b(str(package).encode(), digest_size=6).hexdigest()}"
    if told := os.environ.get("NUMBA_CACHE_DIR"):
        yield Path(told) / "gcodectl" / ours
        return
    yield package / "__pycache__" / "kernels"
    with suppress(RuntimeError):  # nobody's home
        base = os.environ.get("LOCALAPPDATA") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        yield Path(base) / "gcodectl" / ours


def _usable(path: Path) -> bool:
    with suppress(OSError):
        path.mkdir(parents=True, exist_ok=True)
    return path.is_dir() and os.access(path, os.W_OK | os.X_OK)


@lru_cache
def _surroundings() -> str:
    """Return what else machine code depends on, found without importing numba."""
    spec = find_spec("numba")
    stamp = os.stat(spec.origin).st_mtime_ns if spec and spec.origin else 0
    return f"{FORMAT} {sys.version} {stamp} {processor()}"


def path_of(kernel: str, fingerprint: str, signature: str) -> Path | None:
    """Return the file of a kernel, by its name, its fingerprint and its arguments; None where nothing is kept."""
    if (place := folder()) is None:
        return None
    words = f"{signature}\n{_surroundings()}".encode()
    return place / f"{kernel.replace(':', '.')}-{hashlib.blake2b(words, digest_size=6).hexdigest()}-{fingerprint}.o"


def read(path: Path) -> Entry | None:
    """Return what is kept in a file; None where there is none, or it is damaged."""
    try:
        check, data = (whole := path.read_bytes())[:_CHECK], whole[_CHECK:]
    except OSError:
        return None
    if hashlib.blake2b(data, digest_size=_CHECK).digest() != check:
        return None
    head, _, machine_code = data.partition(b"\n")
    symbol, returns = json.loads(head)
    return Entry(symbol, returns, machine_code)


def write(path: Path, entry: Entry) -> None:
    """Keep an entry; where the disk is full or the folder gone, it is not kept."""
    data = json.dumps([entry.symbol, entry.returns]).encode() + b"\n" + entry.machine_code
    with suppress(OSError):
        handle, name = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
        try:
            with open(handle, "wb") as file:
                file.write(hashlib.blake2b(data, digest_size=_CHECK).digest() + data)
            os.chmod(name, 0o644)  # a folder of the system is for all its users
            os.replace(name, path)
        finally:
            with suppress(FileNotFoundError):
                os.unlink(name)
        for old in path.parent.glob(f"{path.name.rpartition('-')[0]}-*.o"):
            if old != path:
                old.unlink(missing_ok=True)  # of a kernel that has changed since


def claim(path: Path) -> bool:
    """Take it on to build what goes to `path`; False where another process that is alive has."""
    busy = path.with_suffix(".busy")
    for _ in range(2):
        try:
            with busy.open("x", encoding="ascii") as file:
                file.write(str(os.getpid()))
            return True
        except FileExistsError:
            if _alive(busy):
                return False
            busy.unlink(missing_ok=True)
        except OSError:
            return True
    return False


def is_busy(path: Path) -> bool:
    """Whether another process is building what goes to `path`."""
    return _alive(path.with_suffix(".busy"))


def release(path: Path) -> None:
    """Say that it is built, or never will be."""
    with suppress(OSError):
        path.with_suffix(".busy").unlink(missing_ok=True)


def _alive(busy: Path) -> bool:
    """Tell whether a claim is another's that lives; one that has not written its number yet does."""
    try:
        if time.time() - busy.stat().st_mtime > LONGEST:
            return False
        number = int(busy.read_text(encoding="ascii") or 0)
        if number and os.name != "nt":  # no signal there asks without killing
            os.kill(number, 0)
        return number != os.getpid()
    except (ProcessLookupError, FileNotFoundError, ValueError):
        return False
    except OSError:
        return True
