from __future__ import annotations

import multiprocessing
import os
import sqlite3
from pathlib import Path

import pytest
from known import by_rule

from gcodectl.calibrate.calibration import Attributes, Calibration, Parameters
from gcodectl.calibrate.store import add, read
from gcodectl.errors import InputError, UsageError


def test_what_is_put_in_comes_out_and_is_not_put_in_twice(tmp_path):
    path = tmp_path / "known.sqlite"
    known = [*by_rule(3, 2), Calibration(Attributes("odd 'name'; --", phases=2, age=0.0), Parameters(acceldelay=-1.0))]
    assert add(path, known) == len(known)
    assert read(path) == known
    assert add(path, known[:2]) == 0
    assert add(path, [Calibration(known[0].attributes, known[0].parameters, "another file")]) == 1
    assert len(read(path)) == len(known) + 1


def _write(path: Path, number: int, gate: object) -> None:
    gate.wait()  # type: ignore[attr-defined]
    for k in range(20):
        add(path, [Calibration(Attributes(f"m{number}"), Parameters(pushouttime=0.1 * k + 0.1), "")])


def test_two_writers_lose_nothing(tmp_path):
    context = multiprocessing.get_context("fork")
    gate = context.Barrier(2)
    path = tmp_path / "known.sqlite"
    writers = [context.Process(target=_write, args=(path, number, gate)) for number in range(2)]
    for one in writers:
        one.start()
    for one in writers:
        one.join(60)
        assert one.exitcode == 0
    assert len(read(path)) == 40


@pytest.mark.parametrize(
    "content", [b"not a database at all, but long enough to look at" * 9, b"SQLite format 3\0 cut"]
)
def test_a_file_that_is_no_store_is_left_as_it_is(tmp_path, content):
    path = tmp_path / "known.sqlite"
    path.write_bytes(content)
    for use in (lambda: read(path), lambda: add(path, by_rule(1, 1))):
        with pytest.raises(InputError, match="left as it is"):
            use()
    assert path.read_bytes() == content


def test_a_damaged_store_is_left_as_it_is(tmp_path):
    path = tmp_path / "known.sqlite"
    add(path, by_rule(30, 5))
    data = bytearray(path.read_bytes())
    data[4096:] = b"\xff" * (len(data) - 4096)
    path.write_bytes(data)
    for use in (lambda: read(path), lambda: add(path, by_rule(1, 1))):
        with pytest.raises(InputError, match="damaged"):
            use()
    assert path.read_bytes() == bytes(data)


def test_another_programs_file_and_a_later_version_are_refused(tmp_path):
    other, later = tmp_path / "other.sqlite", tmp_path / "later.sqlite"
    with sqlite3.connect(other) as file:
        file.execute("CREATE TABLE songs (name)")
    add(later, by_rule(1, 1))
    with sqlite3.connect(later) as file:
        file.execute("PRAGMA user_version = 9")
    before = later.read_bytes()
    with pytest.raises(InputError, match="no store of calibrations"):
        add(other, by_rule(1, 1))
    with pytest.raises(InputError, match=r"version 9.*please update"):
        add(later, by_rule(1, 1))
    assert later.read_bytes() == before


def test_a_write_that_fails_half_way_leaves_the_store_as_it_was(tmp_path):
    path = tmp_path / "known.sqlite"
    add(path, by_rule(2, 1))
    bad = by_rule(3, 1)[2]
    object.__setattr__(bad.attributes, "material", None)  # what the table does not take
    with pytest.raises(InputError):
        add(path, [*by_rule(4, 1)[3:], bad])
    assert read(path) == by_rule(2, 1)


def _die(path: Path) -> None:
    file = sqlite3.connect(path)
    file.isolation_level = None
    file.execute("PRAGMA cache_size = 1")  # so that half of it is in the file already
    file.execute("BEGIN IMMEDIATE")
    file.execute("UPDATE calibrations SET source = 'half' || id || hex(zeroblob(500))")
    os._exit(9)


def test_a_writer_that_dies_leaves_the_store_as_it_was(tmp_path):
    path = tmp_path / "known.sqlite"
    add(path, by_rule(40, 5))
    dying = multiprocessing.get_context("fork").Process(target=_die, args=(path,))
    dying.start()
    dying.join(60)
    assert dying.exitcode == 9
    assert path.with_name("known.sqlite-journal").exists()
    assert read(path) == by_rule(40, 5)
    assert add(path, by_rule(41, 5)) == 5


def test_missing_stores_and_folders_are_said(tmp_path):
    with pytest.raises(InputError, match="no such store"):
        read(tmp_path / "none.sqlite")
    with pytest.raises(UsageError, match="no folder"):
        add(tmp_path / "none" / "known.sqlite", [])
