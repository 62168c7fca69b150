import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcodectl.errors import RefusedError
from gcodectl.link.job import clean, read_lines
from gcodectl.link.wire import numbered


@pytest.mark.parametrize(
    ("text", "command"),
    [
        (b"G1 X1 ; to the left", b"G1 X1"), (b"; nothing", b""), (b"   ", b""), (b"%", b""), (b"\tG28\t", b"G28"),
        (b"G1 (here) X1 (there", b"G1   X1"), (b"M117 50% (half) done", b"M117 50% (half) done"),
        (b"M23 part(1).gco", b"M23 part(1).gco"), (b"N7 G1 X1*33", b"G1 X1"), (b"N7G1 X1 * 33 ", b"G1 X1"),
        (b"N3 M117 5*6", b"M117 5"), (b"M117 5*6", b"M117 5*6"), (b"M110 N5", b""), (b"N5 M110*33", b""),
        ("M117 grün".encode(), b"M117 gr?n"), ("M117 grün".encode("latin-1"), b"M117 gr?n"),
        ("G1 X1 ; süß".encode(), b"G1 X1"), (b"M118 P0 a\x07b", b"M118 P0 a?b"), (b"M1100", b"M1100"),
        (b"EXCLUDE_OBJECT NAME=a", b"EXCLUDE_OBJECT NAME=a"), (b"N", b"N"), (b"M1170 x", b"M1170 x"),
    ],
)  # fmt: skip
def test_a_line_is_cleaned(text: bytes, command: bytes) -> None:
    assert clean(text) == command


@pytest.mark.parametrize(
    "text", [b"M112", b"m112 ; now", b"N4 M112*1", b"M410", "G1 X1\u00a0Y2".encode(), b"G1 X\x001"]
)
def test_what_must_not_be_sent_is_refused_by_line(text: bytes) -> None:
    with pytest.raises(RefusedError, match=r"part\.gcode:line 3:.*take it out"):
        list(read_lines([b"G28\n; a\n" + text + b"\n"], "part.gcode"))


def test_a_line_that_firmware_would_cut_is_refused_before_anything_is_sent() -> None:
    longest = b"M117 " + b"x" * (95 - 5 - len(b"N1010 *99"))
    assert [line.command for line in read_lines([longest + b"\n"])] == [longest]
    assert len(numbered(1001, longest)) - 1 == 95
    with pytest.raises(RefusedError, match=r"line 1:.*firmware cuts lines at 95") as caught:
        list(read_lines([longest + b"xx\n"]))
    assert caught.value.exit_status == 4


def test_line_ends_of_all_kinds_count_the_same() -> None:
    for end in (b"\n", b"\r\n", b"\r"):
        lines = list(read_lines([end.join([b"G28", b"", b"; c", b"G1 X1"])]))
        assert [(line.source, line.command) for line in lines] == [(1, b"G28"), (4, b"G1 X1")]


@given(st.lists(st.sampled_from([b"G28", b"G1 X1;a", b"", b";", b"M117 \xc3\xbc"]), max_size=6), st.data())
def test_chunks_make_no_difference(texts: list[bytes], data: st.DataObject) -> None:
    end = data.draw(st.sampled_from([b"\n", b"\r\n", b"\r"]))
    whole = end.join(texts)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(whole)), max_size=4)))
    pieces = [whole[a:b] for a, b in zip([0, *cuts], [*cuts, len(whole)], strict=True)]
    assert list(read_lines(pieces)) == list(read_lines([whole]))
