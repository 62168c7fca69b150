"""G-code bytes to moves, as the virtual printer reads them."""

from __future__ import annotations

import io

from gcodectl.config import Machine
from gcodectl.gcode.lines import read_chunks
from gcodectl.gcode.modal import interpret
from gcodectl.gcode.parse import parse
from gcodectl.records import Moves


def read_moves(data: bytes, machine: Machine, *, source: str = "", pass_unknown: bool = False) -> Moves:
    """Return all moves of a file; InputError at what cannot be understood safely, unless `pass_unknown`."""
    blocks = parse(read_chunks(io.BytesIO(data)))
    return Moves.concat(list(interpret(blocks, machine, pass_unknown=pass_unknown, source=source)))


def first_layers(data: bytes, moves: Moves, layers: int) -> bytes:
    """Return the lines of a file before layer `layers` begins: all of them, where it has no more."""
    later = moves.line[moves.layer >= layers]
    if not len(later):
        return data
    lines = data.splitlines(keepends=True)
    return b"".join(lines[: int(later[0]) - 1])
