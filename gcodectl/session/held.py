"""Held: one command at a time works on a session, or what the other one did meanwhile would be lost.

The folder itself is locked: the lock is gone with the command that held it, however it ended, and leaves no file.
Windows cannot lock folders and goes without.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gcodectl.errors import InputError, UsageError


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Hold a session's folder; UsageError where another command does, InputError where there is no such folder."""
    if sys.platform == "win32":
        yield
        return
    import fcntl

    try:
        place = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise InputError(
            f"holds no session ({error.strerror}): begin one with `gcodectl learn start`", source=str(folder)
        ) from error
    try:
        try:
            fcntl.flock(place, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise UsageError(
                f"another command works on {folder}: call again when it has ended; nothing was changed"
            ) from None
        except OSError:  # a file system without locks: go without
            yield
            return
        yield
    finally:
        os.close(place)
