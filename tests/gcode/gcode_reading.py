"""How the tests of reading read: bytes to Blocks and Moves in one call, and the corpus where there is one."""

from __future__ import annotations

import io
import os
from contextlib import AbstractContextManager
from pathlib import Path

import moves
import numpy as np
import pytest

from gcodectl.columns import column_fields
from gcodectl.config import Machine
from gcodectl.gcode.lines import read_chunks
from gcodectl.gcode.modal import interpret
from gcodectl.gcode.parse import parse
from gcodectl.records import Blocks, Moves

CORPUS = Path(os.environ["GCODECTL_CORPUS"]) if "GCODECTL_CORPUS" in os.environ else None
needs_corpus = pytest.mark.skipif(CORPUS is None, reason="GCODECTL_CORPUS names no folder of G-code")
FILES = sorted(path for path in CORPUS.iterdir() if path.suffix in (".gcode", ".nc", ".ngc")) if CORPUS else []


def machine(dialect: str = "marlin") -> Machine:
    return Machine("test", dialect=dialect, barrel_diameter=2.0, accel=1000.0, travel_accel=2000.0)


def blocks_of(text: str | bytes) -> Blocks:
    data = text.encode() if isinstance(text, str) else text
    return Blocks.concat([lines.blocks for lines in parse([data])])


def moves_of(text: str | bytes, dialect: str = "marlin", size: int = 1 << 20, pass_unknown: bool = False) -> Moves:
    data = text.encode() if isinstance(text, str) else text
    stream = parse(read_chunks(io.BytesIO(data), size))
    return Moves.concat(list(interpret(stream, machine(dialect), pass_unknown=pass_unknown, source="part.gcode")))


def plain_python() -> AbstractContextManager[None]:
    """Run every kernel of gcodectl.gcode as plain Python inside the block."""
    return moves.plain_python("gcodectl.gcode")


def same_rows(a: Blocks | Moves, b: Blocks | Moves) -> None:
    """Assert that two records hold the same rows over the same lines."""
    assert len(a) == len(b)
    for field in column_fields(type(a)):
        if field.name not in ("start", "end"):
            assert np.array_equal(getattr(a, field.name), getattr(b, field.name), equal_nan=True), field.name
    assert [a.raw(k) for k in range(len(a))] == [b.raw(k) for k in range(len(b))]
