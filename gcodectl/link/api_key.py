"""The key that an upload shows: from the environment or a file, never from the command line, never in a message.

    --api-key-file FILE  before  MOONRAKER_API_KEY or OCTOPRINT_API_KEY  before  GCODECTL_API_KEY

A command line is for everyone to read (`ps`, a shell's history); the environment and a file of mode 600 are not.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Mapping, Sequence
from pathlib import Path

from gcodectl.errors import InputError, UsageError

GENERAL = "GCODECTL_API_KEY"
LONGEST = 1024
"""Bytes: no service gives longer keys, and whoever names a print file here by mistake should not see it sent."""


def find_key(variables: Sequence[str], file: Path | None, environment: Mapping[str, str]) -> str | None:
    """Return the key from `file`, else from the first of `variables` (then the general one) that is set; None without.

    Raises UsageError for what cannot be a key, InputError for a file that cannot be read; neither says the key.
    """
    if file is not None:
        return _checked(_read(file), str(file))
    for name in (*variables, GENERAL):
        if environment.get(name, "").strip():
            return _checked(environment[name], f"the environment's {name}")
    return None


def warning(file: Path) -> str | None:
    """Return what to say where others on this machine may read the key file; None where it is private."""
    mode = stat.S_IMODE(file.stat().st_mode)
    if os.name != "posix" or not mode & (stat.S_IRWXG | stat.S_IRWXO):
        return None
    return f"{file}: others on this machine may open this key (mode {mode:03o}); `chmod 600` it"


def _read(file: Path) -> str:
    try:
        with file.open("rb") as stream:
            return stream.read(LONGEST + 1).decode("ascii", errors="replace")
    except OSError as error:
        raise InputError(f"the API key cannot be read: {error.strerror}", source=str(file)) from None


def _checked(text: str, where: str) -> str:
    key = text.strip()
    if not key or len(key) > LONGEST or not all("!" <= one <= "~" for one in key):
        raise UsageError(f"{where} holds no API key: one word of letters, digits and signs is expected, and no more")
    return key
