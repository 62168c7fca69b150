from functools import reduce
from operator import xor

from hypothesis import given
from hypothesis import strategies as st

from gcodectl.link.wire import UNENDED, Splitter, checksum, numbered


def test_a_numbered_line_is_as_marlin_documents_it() -> None:
    assert numbered(0, b"M110") == b"N0 M110*35\n"
    assert numbered(3, b"T0") == b"N3 T0*57\n"  # RepRap wiki's own example


@given(st.lists(st.binary(max_size=8).map(lambda text: text.replace(b"\r", b"").replace(b"\n", b"")), max_size=6))
def test_every_split_gives_the_same_lines(lines: list[bytes]) -> None:
    data = b"\r\n".join(lines) + b"\n"
    wanted = [line for line in lines if line]
    assert Splitter().feed(data) == wanted
    for cut in range(len(data)):
        splitter = Splitter()
        assert splitter.feed(data[:cut]) + splitter.feed(data[cut:]) == wanted
    splitter = Splitter()
    assert [line for k in range(len(data)) for line in splitter.feed(data[k : k + 1])] == wanted


def test_bytes_without_an_end_do_not_grow_for_ever() -> None:
    splitter = Splitter()
    assert splitter.feed(b"x" * (UNENDED + 1)) == [b"x" * (UNENDED + 1)]
    assert splitter.feed(b"ok\n") == [b"ok"]


@given(st.binary(max_size=200))
def test_the_checksum_is_the_xor_of_all_bytes(data: bytes) -> None:
    assert checksum(data) == reduce(xor, data, 0)
