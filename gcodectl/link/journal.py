"""What is known of a job should it break off: the last acknowledged line, on disk, whole or not at all."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import tempfile
from contextlib import suppress
from pathlib import Path

from gcodectl.errors import InputError

EVERY = 1.0
"""s between two entries."""


@dataclasses.dataclass(frozen=True)
class Entry:
    """How far a job has come."""

    file: str
    digest: str
    """SHA-256 of the file, and of how it was filtered."""
    line: int
    """The last line that the printer acknowledged; it may still have been in its buffer."""
    lines: int | None
    """Of the whole job, where that is known."""
    pulled: float
    """mm of E that the plunger was pulled back when the job was stopped."""


def digest(path: Path, how: str) -> str:
    """Return what tells one job from another: the file's content, and how it is filtered."""
    with path.open("rb") as file:
        return hashlib.sha256(hashlib.file_digest(file, "sha256").digest() + how.encode()).hexdigest()


def journal_path(file: Path, environment: dict[str, str]) -> Path:
    """Return where the journal of a file is kept: in the user's state folder, named after the file."""
    base = environment.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    tag = hashlib.sha256(str(file.resolve()).encode()).hexdigest()[:12]
    return Path(base) / "gcodectl" / f"{file.stem}-{tag}.json"


def write(path: Path, entry: Entry) -> None:
    """Replace the journal by `entry`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(handle, "w") as file:
            json.dump(dataclasses.asdict(entry), file)
        Path(name).replace(path)
    except BaseException:
        with suppress(FileNotFoundError):
            Path(name).unlink()
        raise


def read(path: Path) -> Entry:
    """Read a journal; InputError where there is none, or where it is none of ours."""
    try:
        return Entry(**json.loads(path.read_text()))
    except FileNotFoundError:
        raise InputError("no job of this file has broken off: there is nothing to resume") from None
    except (ValueError, TypeError) as error:
        raise InputError(f"the journal cannot be read ({error}); remove it and print anew", source=str(path)) from None


def remove(path: Path) -> None:
    """Remove a journal, if there is one: the job is done."""
    path.unlink(missing_ok=True)
