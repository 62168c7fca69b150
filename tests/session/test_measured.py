"""Tables of measurements: headings and units that are known, and a sentence for everything that is wrong."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcodectl.errors import InputError
from gcodectl.session.headings import read_headings
from gcodectl.session.measured import Series, area_of, read_measured, width_of

ROWS = [(0.1 * k, 5.0 + math.sin(k)) for k in range(30)]


def write(path, head, rows=ROWS, mark=","):
    text = "\n".join([head, *(mark.join(map(str, row)) for row in rows)])
    path.write_text(text + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("head", "kind", "x", "y"),
    [
        ("t,q", "t,q", 1.0, 1.0),
        ("t [ms],q [mm^3/s]", "t,q", 1e-3, 1.0),
        ("Time (min),Flow Rate (ml/min)", "t,q", 60.0, 1000 / 60),
        ("time_ms,q_mm3_min", "t,q", 1e-3, 1 / 60),
        ("t,q [µl/s]", "t,q", 1.0, 1.0),
        ("s,area", "s,area", 1.0, 1.0),
        ("s [cm],area [mm²]", "s,area", 10.0, 1.0),
        ("place,cross_section_um2", "s,area", 1.0, 1e-6),
        ("s,width [µm]", "s,width", 1.0, 1e-3),
        ("distance_mm,road width (in)", "s,width", 1.0, 25.4),
        ('"s","width"', "s,width", 1.0, 1.0),
    ],
)
def test_headings_and_units(tmp_path, head, kind, x, y):
    found = read_measured(write(tmp_path / "m.csv", head))
    assert found.kind == kind
    assert found.x == pytest.approx([x * row[0] for row in ROWS])
    assert found.y == pytest.approx([y * row[1] for row in ROWS])


def test_other_columns_other_marks_and_comments_do_not_matter(tmp_path):
    rows = [(k, "x", 5, 0.1 * k) for k in range(30)]
    path = write(tmp_path / "m.csv", "# camera 2\nnumber;remark;q;t", rows, ";")
    found = read_measured(path)
    assert found.x[3] == pytest.approx(0.3)
    assert found.line[0] == 3
    decimal = write(tmp_path / "d.csv", "t;q", [(f"0,{k:02}", "5,5") for k in range(30)], ";")
    assert read_measured(decimal).y[0] == 5.5
    tabs = write(tmp_path / "t.csv", "s\twidth\theight [um]", [(k, 1, 600) for k in range(30)], "\t")
    assert read_measured(tabs).height == pytest.approx(0.6)


def test_an_empty_cell_is_a_hole(tmp_path):
    rows = [(0.1 * k, "" if k == 5 else 1.0) for k in range(30)]
    assert math.isnan(read_measured(write(tmp_path / "m.csv", "t,q", rows)).y[5])
    beads = [(0.1 * k, 1.0, "" if k == 5 else 0.6) for k in range(30)]
    assert math.isnan(read_measured(write(tmp_path / "h.csv", "s,width,height", beads)).y[5])


def test_empty_cells_behind_the_last_heading_do_not_matter(tmp_path):
    assert len(read_measured(write(tmp_path / "m.csv", "t,q", [(*row, "", " ") for row in ROWS])).x) == len(ROWS)


def test_a_heading_in_another_encoding_says_what_to_save_it_as(tmp_path):
    path = tmp_path / "m.csv"
    path.write_bytes("s,width [\u00b5m]\n".encode("latin-1") + b"1,840\n" * 30)
    with pytest.raises(InputError, match="save it as CSV in UTF-8"):
        read_measured(path)


@pytest.mark.parametrize(
    ("head", "rows", "said"),
    [
        ("", [], "is empty: name two columns"),
        ("t,q", [], "has 0 rows of numbers: at least 20"),
        ("t,q", ROWS[:5], "has 5 rows"),
        ("0,5", ROWS, "line 1: `0,5` has no heading"),
        ("x,y", ROWS, "none of them: name two columns: t,q (s, mm^3/s)"),
        ("t,width", ROWS, "only t, width of them"),
        ("t [h],q", ROWS, "gives t in 'h', which is not known: use one of s, ms, min"),
        ("t,q [g/s]", ROWS, "use one of mm3/s"),
        ("t,time", ROWS, "two columns of t: keep one"),
        ("t,q,s,width", [(*row, 1, 1) for row in ROWS], "has t,q and s,width: keep one pair"),
        ("t,q", [*ROWS[:20], (2.1, "much"), *ROWS[22:]], "line 22: `2.1,much` has 'much' where q should be a number"),
        ("t,q", [*ROWS[:25], (0.3, 5.0), *ROWS[26:]], "line 27: time runs backwards: t is 0.3 after 2.4"),
        ("t,q", [*ROWS[:20], (2.1, "n/a"), *ROWS[22:]], "should be a number: leave the cell empty where nothing was"),
        ("t,q", [("0,1", "5,5"), *ROWS], "line 2: `0,1,5,5` has 4 cells under 2 headings: where numbers have decimal"),
        ("s,width", [*ROWS[:25], (0.3, 5.0), *ROWS[26:]], "the place goes back"),
        ("s,width", [*ROWS[:20], (2.5, -0.3), *ROWS[26:]], "width is -0.3: no road is smaller than nothing"),
        ("s,width,height", [(*row, -0.1) for row in ROWS], "height is -0.1: no road is smaller than nothing"),
        ("q,t", ROWS, "the columns look swapped"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, head, rows, said):
    with pytest.raises(InputError) as caught:
        read_measured(write(tmp_path / "m.csv", head, rows))
    assert said in str(caught.value)
    assert "m.csv" in str(caught.value)


def test_what_is_no_table(tmp_path):
    (tmp_path / "photo.png").write_bytes(b"\x89PNG\r\n\x1a\n\xff\xfe")
    with pytest.raises(InputError, match="cannot be read as a table"):
        read_measured(tmp_path / "photo.png")
    with pytest.raises(InputError, match="no such file"):
        read_measured(tmp_path / "none.csv")


def test_a_bead_is_as_wide_as_its_area_says():
    width = np.array([0.0, 0.1, 0.55, 0.6, 0.84, 2.0])
    area = area_of(width, 0.6)
    assert width_of(area, 0.6) == pytest.approx(width, abs=1e-12)
    assert area[-1] == pytest.approx(1.4 * 0.6 + math.pi * 0.09)
    assert (np.diff(area) > 0).all()


def test_flow_is_area_times_speed():
    t, q = Series("s,width", np.array([0.0, 10.0]), np.array([0.0, 2.0])).flow(10.0, 0.6)
    assert t.tolist() == [0.0, 1.0]
    assert q[1] == pytest.approx(10.0 * (1.4 * 0.6 + math.pi * 0.09))
    own = Series("s,width", np.array([0.0, 10.0]), np.array([2.0, 2.0]), height=np.array([0.6, 1.0]))
    assert own.flow(10.0, 9.9)[1].tolist() == pytest.approx((10.0 * area_of(own.y, np.array([0.6, 1.0]))).tolist())


def test_units_are_read_whatever_their_spelling():
    for spelling in ("q [mm³ / s]", "q [MM^3/S]", "q (mm3 per s)", "flow_mm3_s"):
        assert read_headings(["t", spelling], "f", 1)["q"] == (1, 1.0)
