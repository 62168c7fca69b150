"""How the tests of the filter run it: our own files, the corpus, and what was composed beside what came out."""

from __future__ import annotations

import io
import os
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from gcodectl.cli.common import material_sets
from gcodectl.config import Machine, load_machine
from gcodectl.gcode.lines import read_chunks
from gcodectl.pipeline import Options, compose_moves, filter_stream, read_moves
from gcodectl.records import Command, Composed, Moves, Profile, SpeedPlan, Tasks

DATA = Path(__file__).parent / "data"
OWN = sorted(DATA.glob("*.gcode"))
CORPUS = Path(os.environ["GCODECTL_CORPUS"]) if "GCODECTL_CORPUS" in os.environ else None
needs_corpus = pytest.mark.skipif(CORPUS is None, reason="GCODECTL_CORPUS names no folder of G-code")
FILES = sorted(path for path in CORPUS.iterdir() if path.suffix in (".gcode", ".nc", ".ngc")) if CORPUS else []

HEAD = "G21\nG90\nM83\nG1 X0 Y0 Z0.6 F600\n"
"""What a made-up file begins with: everything known, relative E, 10 mm/s."""


@lru_cache
def syringe() -> Machine:
    return load_machine("syringe")


@lru_cache
def options(*materials: str, **changes: object) -> Options:
    return Options(syringe(), sets=material_sets(list(materials or ["paste-a"]), 0.84), **changes)  # type: ignore[arg-type]


NEUTRAL = Options(load_machine("syringe"))


def filtered(data: str | bytes | Iterable[bytes], how: Options | None = None, size: int = 1 << 20) -> bytes:
    """Filter bytes as a stream of chunks of at most `size` bytes (whole lines)."""
    if isinstance(data, str):
        data = data.encode()
    chunks = read_chunks(io.BytesIO(data), size) if isinstance(data, bytes) else data
    return b"".join(filter_stream(chunks, how or options()))


def body(out: bytes) -> list[str]:
    """The lines of an output without our own comments."""
    return [line for line in out.decode("latin-1").splitlines() if not line.startswith("; gcodectl")]


def moves_of(data: str | bytes, how: Options | None = None) -> Moves:
    data = data.encode() if isinstance(data, str) else data
    return Moves.concat(list(read_moves(read_chunks(io.BytesIO(data)), how or options())))


def composed(data: bytes, how: Options | None = None) -> Composed:
    """What the filter composes for a file, as one piece."""
    how = how or options()
    parts = list(compose_moves(read_moves(read_chunks(io.BytesIO(data)), how), how))
    first = round(parts[0].command.t0 / parts[0].command.dt)
    end = max(round(part.command.t1 / part.command.dt) for part in parts)
    u, reference = np.zeros(end - first), np.zeros(end - first)
    for part in parts:
        at = round(part.command.t0 / part.command.dt) - first
        u[at : at + len(part.command.u)] = part.command.u
        reference[at : at + len(part.command.u)] = part.command.reference
    return Composed(
        Moves.concat([part.moves for part in parts]),
        SpeedPlan.concat([part.speeds for part in parts]),
        Profile.concat([part.profile for part in parts]),
        Tasks.concat([part.tasks for part in parts]),
        Command(first * parts[0].command.dt, parts[0].command.dt, u, reference),
    )
