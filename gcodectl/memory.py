"""Memory: let the C library keep what arrays have freed, for the arrays to come.

Every chunk of a stream allocates and frees the same few dozen arrays of some hundred kB each. glibc gives blocks of
that size back to the system at once, and the system hands them out again page by page, zeroed: a quarter of the time
of reading G-code, measured. What is kept is what one chunk needs; it does not grow with the file.
"""

from __future__ import annotations

import ctypes

# mallopt's names, malloc.h of glibc
M_TRIM_THRESHOLD, M_TOP_PAD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -2, -3, -8
MIB = 1 << 20


def keep_freed_memory() -> bool:
    """Ask the C library to keep freed memory up to 32 MiB a block; False where it knows no such thing (no glibc)."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return False
    # one arena: what one thread frees, the other takes
    wanted = {M_MMAP_THRESHOLD: 32 * MIB, M_TRIM_THRESHOLD: 512 * MIB, M_TOP_PAD: 16 * MIB, M_ARENA_MAX: 1}
    kept = [mallopt(name, value) == 1 for name, value in wanted.items()]
    return all(kept)
