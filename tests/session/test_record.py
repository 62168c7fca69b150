"""The session's file: whole or as it was, and nothing but itself is taken for it."""

from __future__ import annotations

import json
import math

import pytest
from sessions import learned, session

from gcodectl.errors import InputError, UsageError
from gcodectl.session.record import NAME, load, save


def test_what_is_saved_comes_back(tmp_path):
    now = learned(1)
    save(now, tmp_path)
    again = load(tmp_path)
    for one, other in zip(now.trials, again.trials, strict=True):
        assert other.u.tolist() == one.u.tolist()
        assert [each.source for each in other.prints] == [each.source for each in one.prints]
    assert again.trials[0].q.tolist() == now.trials[0].q.tolist()
    assert again.setup.routine == now.setup.routine
    assert again.setup.printout.layout.path.tolist() == now.setup.printout.layout.path.tolist()
    assert again.setup.printout.machine == now.setup.printout.machine
    first = (tmp_path / NAME).read_bytes()
    save(again, tmp_path)
    assert (tmp_path / NAME).read_bytes() == first
    assert [path.name for path in tmp_path.iterdir()] == [NAME]


def test_a_crash_while_saving_leaves_the_session_as_it_was(tmp_path, monkeypatch):
    now = session()
    save(now, tmp_path)
    before = (tmp_path / NAME).read_bytes()

    def full(*_words, **_more):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(json, "dump", full)
    with pytest.raises(OSError, match="No space"):
        save(now.with_trial(now.trials[0]), tmp_path)
    assert (tmp_path / NAME).read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == [NAME]


def spoiled(tmp_path, change):
    save(session(), tmp_path)
    table = json.loads((tmp_path / NAME).read_text())
    change(table)
    (tmp_path / NAME).write_text(json.dumps(table))
    return tmp_path


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda table: table.update(version=7, gcodectl="9.9"), "of format 7 (gcodectl 9.9)"),
        (lambda table: table.update(format="gcodectl-library"), "is not a learning session"),
        (lambda table: table.pop("trials"), "is damaged: 'trials'"),
        (lambda table: table["setup"]["printout"]["machine"].update(accel=-1), "is damaged: machine 'syringe': accel"),
        (lambda table: table["setup"].update(surprise=1), "is damaged"),
        (lambda table: table["trials"][0].pop("u"), "is damaged"),
        (lambda table: table["trials"][0]["u"].pop(), "is damaged: trial 0 has 3388 samples, and its routine 3389"),
        (lambda table: table["trials"][0].update(u=[math.nan] * 3389), "is damaged: trial 0 has samples that are no"),
        (lambda table: table["trials"][0].update(number=3), "is damaged: trial 3 stands where trial 0 should"),
    ],
)
def test_a_session_that_cannot_be_read_is_left_alone(tmp_path, change, said):
    folder = spoiled(tmp_path, change)
    before = (folder / NAME).read_bytes()
    with pytest.raises(InputError) as caught:
        load(folder)
    assert said in str(caught.value)
    assert NAME in str(caught.value)
    assert (folder / NAME).read_bytes() == before


def test_what_is_no_session(tmp_path):
    with pytest.raises(InputError, match="holds no session: begin one with"):
        load(tmp_path)
    for data in (b"", b"[]", b"\xff", b'{"format": "gcodectl-session", "version": 1}'):
        (tmp_path / NAME).write_bytes(data)
        with pytest.raises(InputError, match=NAME):
            load(tmp_path)


def test_a_trial_that_is_not_there():
    with pytest.raises(UsageError, match="there is no trial 3 in this session: it has 0 to 0"):
        session().trial(3)
