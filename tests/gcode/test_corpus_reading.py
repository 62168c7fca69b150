"""Every file of the corpus, read; and some of them once more by a simple interpreter that shares no code with ours."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from gcode_reading import CORPUS, FILES, moves_of, needs_corpus

from gcodectl.errors import InputError
from gcodectl.records import Flag, Kind

pytestmark = needs_corpus

REFUSED = {"linuxcnc_3d_chips.head600.ngc": (8, "numbered parameters")}
SIMPLE = (
    "paste_cube_prusaslicer.gcode",
    "paste_features_prusaslicer.gcode",
    "pellet_vase_prusaslicer.gcode",
    "cura_ender3_absE.gcode",
    "aw_arcs_relE.gcode",
    "aw_cura_cyl_arcs_absE.gcode",
    "aw_vase_helix_3Darcs.gcode",
    "ps_cube10_relE.gcode",
    "universal-g-code-sender_electric_turtle.nc",
    "kisslicer.head3000.gcode",
)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
@pytest.mark.parametrize("dialect", ["marlin", "klipper", "reprapfirmware"])
def test_every_file_is_followed_or_refused_with_a_reason(path: Path, dialect: str) -> None:
    data = path.read_bytes()
    if path.name in REFUSED:
        line, reason = REFUSED[path.name]
        with pytest.raises(InputError, match=reason) as caught:
            moves_of(data, dialect)
        assert caught.value.line == line
        return
    moves = moves_of(data, dialect, 30_000)
    assert len(moves) == len(data.splitlines()) or b"\r" in data or b"\x0c" in data
    if dialect == "marlin":
        assert b"".join(moves.raw(row) for row in range(len(moves))) == data
    assert np.array_equal(moves.p0[1:], moves.p1[:-1], equal_nan=True)
    assert np.array_equal(moves.row, np.arange(len(moves)))
    known = (moves.flags & Flag.KNOWN) != 0
    assert np.isfinite(moves.length[known]).all()
    assert (np.diff(moves.layer) < 0).sum() <= 1  # where the first mark begins the count anew


class Simple:
    """G0-G3, G28, G90-G92, M82/M83, M221 the way a page of Python does them; None is unknown."""

    def __init__(self) -> None:
        self.at: dict[str, float | None] = dict.fromkeys("XYZE")
        self.relative = False
        self.e_relative: bool | None = None
        self.flow = 1.0
        self.motion = ""
        self.e = self.path = 0.0

    def line(self, text: str) -> None:
        text = re.sub(r"\(.*?\)", "", text.split(";")[0]).strip()
        if "{" in text:
            self.at = dict.fromkeys("XYZE")
            self.e_relative = None
            return
        for command in re.split(r"\s+(?=[GMT]\d)", text):
            words = {w[0]: w[1:] for w in command.split()}
            head = command.split()[0] if command else ""
            if head in ("G0", "G1", "G2", "G3"):
                self.move(head, {k: float(v) for k, v in words.items() if k != "G"})
            elif head in ("G28", "G80", "G29", "M84", "M84"):
                self.at.update(X=None, Y=None, Z=None)
            elif head in ("G90", "G91"):
                self.relative = self.e_relative = head == "G91"
            elif head in ("M82", "M83"):
                self.e_relative = head == "M83"
            elif head == "G92":
                self.at.update({k: float(v) for k, v in words.items() if k in "XYZE"})
            elif head == "M221":
                self.flow = float(words["S"]) / 100
            elif head[:1] == "T":
                self.at.update(X=None, Y=None, E=None)

    def move(self, head: str, words: dict[str, float]) -> None:
        start = dict(self.at)
        for axis in "XYZ":
            if axis in words:
                base = self.at[axis] if self.relative else 0.0
                self.at[axis] = None if base is None else base + words[axis]
        if "E" in words:
            if self.e_relative:
                self.e += words["E"] * self.flow
            elif self.e_relative is False:
                before = self.at["E"]
                self.e += 0.0 if before is None else (words["E"] - before) * self.flow
                self.at["E"] = words["E"]
        deltas = [(self.at[a] or 0.0) - (start[a] or 0.0) for a in "XYZ"]
        if any(start[a] is None or self.at[a] is None for a in "XYZ"):
            return
        if head in ("G0", "G1"):
            self.path += math.dist((0, 0, 0), deltas)
            return
        i, j = words.get("I", 0.0), words.get("J", 0.0)
        turn = math.atan2(deltas[1] - j, deltas[0] - i) - math.atan2(-j, -i)
        turn = turn % (2 * math.pi) if head == "G3" else -((-turn) % (2 * math.pi))
        self.path += math.hypot(math.hypot(i, j) * turn, deltas[2])


@pytest.mark.parametrize("name", SIMPLE)
def test_a_simple_interpreter_agrees(name: str) -> None:
    assert CORPUS is not None
    data = (CORPUS / name).read_bytes()
    moves = moves_of(data)
    simple = Simple()
    for line in data.decode("utf-8", errors="replace").splitlines():
        simple.line(line)
    assert moves.e.sum() == pytest.approx(simple.e, abs=1e-6)
    end = [math.nan if simple.at[a] is None else simple.at[a] for a in "XYZ"]
    assert moves.p1[-1] == pytest.approx(end, abs=1e-9, nan_ok=True)
    sure = ~np.isnan(moves.p0 + moves.p1).any(axis=1) & np.isin(moves.kind, (Kind.LINE, Kind.ARC))
    assert moves.length[sure].sum() == pytest.approx(simple.path, rel=1e-4)


def test_what_the_paste_cube_is() -> None:
    assert CORPUS is not None
    moves = moves_of((CORPUS / "paste_cube_prusaslicer.gcode").read_bytes())
    assert moves.layer.max() == 39
    assert moves.decimals[-1].tolist() == [3, 5]
    motion = np.isin(moves.kind, (Kind.LINE, Kind.ARC))
    assert (moves.flags[motion] & Flag.KNOWN != 0).mean() > 0.99
