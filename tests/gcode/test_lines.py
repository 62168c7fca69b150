import io
import os
import threading
from collections.abc import Iterator
from typing import BinaryIO, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcodectl.errors import InputError
from gcodectl.gcode.lines import MAX_LINE, read_chunks


@given(data=st.binary(max_size=300).map(lambda b: b.replace(b"\x07", b"\n")), size=st.integers(1, 40))
def test_every_byte_comes_out_in_whole_lines(data: bytes, size: int) -> None:
    chunks = list(read_chunks(io.BytesIO(data), size))
    assert b"".join(chunks) == data
    assert all(chunk.endswith(b"\n") for chunk in chunks[:-1])
    assert all(chunks)


def test_an_endless_pipe_gives_its_first_line_before_it_ends() -> None:
    reader, writer = os.pipe()
    with os.fdopen(reader, "rb") as stream:
        chunks: Iterator[bytes] = read_chunks(stream)
        os.write(writer, b"G28\nG1 X")
        assert next(chunks) == b"G28\n"
        os.write(writer, b"5\n")
        assert next(chunks) == b"G1 X5\n"
        threading.Timer(0.01, os.close, (writer,)).start()
        assert list(chunks) == []


def test_a_raw_stream_without_read1_is_read_too() -> None:
    class Raw:
        def __init__(self) -> None:
            self.parts = [b"G1 X1\nG1", b" X2", b"\n", b""]

        def read(self, size: int) -> bytes:
            assert size > 0
            return self.parts.pop(0)

    assert list(read_chunks(cast(BinaryIO, Raw()))) == [b"G1 X1\n", b"G1 X2\n"]


@pytest.mark.parametrize("size", [1 << 20, 1 << 16, 1 << 24])
def test_a_line_too_long_is_refused_with_its_number(size: int) -> None:
    long = b";" * (MAX_LINE - 1) + b"\n"
    assert b"".join(read_chunks(io.BytesIO(b"G28\n" + long), size)) == b"G28\n" + long
    with pytest.raises(InputError, match=r"line 3.*longer than") as caught:
        list(read_chunks(io.BytesIO(b"G28\nG90\n;" + long), size))
    assert caught.value.line == 3
