"""Store: calibrations in one SQLite file.

Every write is one transaction that begins by taking the write lock (BEGIN IMMEDIATE) and waits for another writer's to
end: two of them at once both get their rows in, and a crash leaves the file as it was. A file that is no store, is
damaged, or was made by a later version is refused and not touched. A calibration that is there already, from the same
source with the same numbers, is not added twice: importing a folder again adds nothing.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from gcodectl.calibrate.calibration import ATTRIBUTES, PARAMETERS, Attributes, Calibration, Parameters
from gcodectl.errors import InputError, UsageError

VERSION = 1
"""Of the table; kept in the file's user_version."""
MARK = 0x67636463
"""The file's application_id: `gcdc`."""
PATIENCE = 30.0
"""Seconds to wait for another writer."""
_COLUMNS = (*ATTRIBUTES, *PARAMETERS, "source")
_TEXT = {name for name in ATTRIBUTES if "str" in str(Attributes.__dataclass_fields__[name].type)} | {"source"}


def add(path: Path, calibrations: Sequence[Calibration]) -> int:
    """Put calibrations into the store at `path`, which is made where there is none; returns how many were new."""
    names, marks = ", ".join(_COLUMNS), ", ".join("?" * (len(_COLUMNS) + 1))
    rows = [_row(one) for one in calibrations]
    with _opened(path, make=True) as file:
        file.execute("BEGIN IMMEDIATE")
        _check(file, path, make=True)
        before = file.total_changes
        file.executemany(
            f"INSERT INTO calibrations ({names}, same) VALUES ({marks}) ON CONFLICT (same) DO NOTHING", rows
        )
        added = file.total_changes - before
        file.execute("COMMIT")
    return added


def read(path: Path) -> list[Calibration]:
    """Return all calibrations of the store, in the order in which they came; InputError where it is none."""
    if not path.is_file():
        raise InputError("there is no such store; `gcodectl calibrate import` or `add` makes one", source=str(path))
    with _opened(path) as file:
        _check(file, path, make=False)
        found = file.execute(f"SELECT {', '.join(_COLUMNS)} FROM calibrations ORDER BY id").fetchall()
    return [_calibration(path, row) for row in found]


def _row(one: Calibration) -> list[object]:
    values = [getattr(one.attributes, name) for name in ATTRIBUTES]
    values += [getattr(one.parameters, name) for name in PARAMETERS]
    values.append(one.source)
    return [*values, json.dumps(values)]


def _calibration(path: Path, row: Sequence[object]) -> Calibration:
    values = dict(zip(_COLUMNS, row, strict=True))
    try:
        attributes = Attributes(**{name: values[name] for name in ATTRIBUTES})  # type: ignore[arg-type]
        parameters = Parameters(**{name: values[name] for name in PARAMETERS})  # type: ignore[arg-type]
    except (UsageError, TypeError, AttributeError) as error:
        raise InputError(f"holds a calibration that cannot be: {error}", source=str(path)) from error
    return Calibration(attributes, parameters, str(values["source"]))


@contextmanager
def _opened(path: Path, *, make: bool = False) -> Iterator[sqlite3.Connection]:
    """Give a connection that commits nothing by itself; what SQLite says becomes a sentence."""
    if make and not path.parent.is_dir():
        raise UsageError(f"there is no folder {path.parent} to make {path.name} in; make it first")
    try:
        mode = "rwc" if make else "rw"  # not "ro": what a writer that died left half done is rolled back at opening
        file = sqlite3.connect(f"{path.absolute().as_uri()}?mode={mode}", uri=True, timeout=PATIENCE)
        file.isolation_level = None
        try:
            yield file
        except BaseException:
            if file.in_transaction:
                file.execute("ROLLBACK")
            raise
        finally:
            file.close()
    except sqlite3.OperationalError as error:
        busy = "locked" in str(error)
        remedy = "another program is writing to it; try again" if busy else f"cannot be used: {error}"
        raise InputError(remedy, source=str(path)) from error
    except sqlite3.DatabaseError as error:
        raise InputError(
            f"is no store of calibrations, or is damaged ({error}); it was left as it is", source=str(path)
        ) from error


def _check(file: sqlite3.Connection, path: Path, *, make: bool) -> None:
    """Check that this is a store that we can read; lay out an empty file where `make`."""
    (mark,) = file.execute("PRAGMA application_id").fetchone()
    (version,) = file.execute("PRAGMA user_version").fetchone()
    (tables,) = file.execute("SELECT count(*) FROM sqlite_master").fetchone()
    if not tables and not mark and make:
        columns = ", ".join(f"{name} {_kind(name)}" for name in _COLUMNS)
        file.execute(f"CREATE TABLE calibrations (id INTEGER PRIMARY KEY, {columns}, same TEXT NOT NULL UNIQUE)")
        file.execute(f"PRAGMA application_id = {MARK}")
        file.execute(f"PRAGMA user_version = {VERSION}")
        return
    if mark != MARK:
        raise InputError("is no store of calibrations; it was left as it is", source=str(path))
    if version != VERSION:
        raise InputError(
            f"is a store of version {version}, and this gcodectl reads version {VERSION}: please update it; the store "
            "was left as it is", source=str(path),
        )  # fmt: skip


def _kind(name: str) -> str:
    if name in ("material", "source"):
        return "TEXT NOT NULL"
    return "TEXT" if name in _TEXT else "INTEGER" if name == "phases" else "REAL"
