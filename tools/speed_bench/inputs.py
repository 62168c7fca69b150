"""Large inputs, made of small ones, the same every time and kept between runs.

A sliced file is `head | layers | tail`. Repeated in Z it becomes one tall part:

    head | layers, Z+0 | seam | layers, Z+h | seam | layers, Z+2h | ... | tail

The seam pushes back what the last layer has left retracted, as the head has done before the first. Only Z words and
`;Z:` comments change, so every byte else is a slicer's. Files are written piece by piece: a process inherits the peak
memory of the one that starts it (Linux keeps the higher of the two across exec), so the bench itself must stay small.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from gcodectl.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "build" / "speed"
STAR = ROOT / "tests" / "data" / "star_rel.gcode"
ARCS = ROOT / "tests" / "data" / "arcs_rel.gcode"
VERSION = b"1"
"""Changes when the same recipe makes other bytes."""
MB = 1e6

_Z = re.compile(rb"^((?:G0?[0-3] [^;\n]*?\bZ)|;Z:)(-?[0-9.]+)", re.MULTILINE)
_MOVE = re.compile(rb"^(G0?[0-3]|G92)\b[^;\n]*?\bE(-?[0-9.]+)", re.MULTILINE)
_E_ALONE = re.compile(rb"^G1 E\S+ F([0-9.]+)", re.MULTILINE)


@dataclass(frozen=True)
class Family:
    """A kind of input, and who prints it."""

    name: str
    machine: str
    material: str
    corpus: str
    """Its file in the corpus; none: made by formula."""
    fallback: Path
    """What is repeated where there is no corpus."""


@dataclass(frozen=True)
class Input:
    """One file to measure on."""

    family: Family
    path: Path
    bytes: int
    lines: int


FAMILIES = (
    Family("real", "filament", "filament", "ps_mk3_cube20_relE.gcode", STAR),
    Family("arcs", "filament", "filament", "aw_arcs_relE.gcode", ARCS),
    Family("fine", "filament", "filament", "", STAR),
    Family("paste", "syringe", "paste-a", "paste_cube_prusaslicer.gcode", STAR),
)


def make_input(family: Family, megabytes: float, folder: Path = FOLDER) -> Input:
    """Return `family`'s input of about this size (at least one copy), made where it is not there yet."""
    source = _source(family)
    made_of = hashlib.sha256(VERSION + (source.read_bytes() if source else b"fine")).hexdigest()[:12]
    path = folder / f"{family.name}-{megabytes:g}MB-{made_of}.gcode"
    told = path.with_suffix(".json")
    if not (path.exists() and told.exists()):
        folder.mkdir(parents=True, exist_ok=True)
        pieces = repeated(source.read_bytes(), megabytes * MB) if source else fine_curves(megabytes * MB)
        part, size, lines = path.with_suffix(".part"), 0, 0
        with part.open("wb") as file:
            for piece in pieces:
                size, lines = size + file.write(piece), lines + piece.count(b"\n")
        part.replace(path)
        told.write_text(json.dumps({"bytes": size, "lines": lines}))
    about = json.loads(told.read_text())
    return Input(family, path, int(about["bytes"]), int(about["lines"]))


def _source(family: Family) -> Path | None:
    if not family.corpus:
        return None
    corpus = Path(os.environ.get("GCODECTL_CORPUS", ROOT.parent / "shared" / "corpus"))
    return corpus / family.corpus if (corpus / family.corpus).exists() else family.fallback


def repeated(data: bytes, size: float) -> Iterator[bytes]:
    """Yield a sliced file repeated in Z to about `size` bytes; InputError where its layers are not to be found."""
    head, layers, tail = split(data)
    seam = seam_after(head, layers)
    height = max((float(one[2]) for one in _Z.finditer(layers) if one[1] == b";Z:"), default=0.0)
    if height <= 0.0:
        raise InputError("no ;Z: tells how high its layers are, so it cannot be repeated in Z")
    copies = max(1, round((size - len(head) - len(tail)) / (len(layers) + len(seam))))
    yield head
    for copy in range(copies):
        yield (seam if copy else b"") + raised(layers, copy * height)
    yield tail


def split(data: bytes) -> tuple[bytes, bytes, bytes]:
    """Cut a sliced file into what stands before its layers, the layers, and what ends the print."""
    begin = data.find(b";LAYER_CHANGE\n")
    end = data.rfind(b"\n;TYPE:Custom\n") + 1
    if end <= begin:
        last = max((one.end() for one in _MOVE.finditer(data)), default=0)
        end = data.find(b"\n", last) + 1
    if begin < 0 or end <= begin:
        raise InputError("its layers are not to be found: this takes files of PrusaSlicer, with ;LAYER_CHANGE")
    return data[:begin], data[begin:end], data[end:]


def raised(layers: bytes, by: float) -> bytes:
    """Return layers with `by` mm added to every Z."""
    if by == 0.0:
        return layers
    return _Z.sub(lambda one: one[1] + f"{float(one[2]) + by:.3f}".rstrip("0").rstrip(".").encode(), layers)


def seam_after(head: bytes, layers: bytes) -> bytes:
    """Return the lines that push back what `layers` leaves retracted at its end."""
    relative = head.rfind(b"M83") > head.rfind(b"M82")
    depth = at = 0.0
    for one in _MOVE.finditer(layers):
        value = float(one[2])
        if one[1] == b"G92":
            at = value
        else:
            step = value if relative else value - at
            at = value
            depth = max(0.0, depth - step)
    if depth < 1e-6:
        return b""
    feeds = _E_ALONE.findall(layers)
    push = f"G1 E{depth:.5g} F{feeds[-1].decode() if feeds else '600'}\n".encode()
    return push if relative else b"G92 E0\n" + push + b"G92 E0\n"


def fine_curves(size: float, step: float = 0.1) -> Iterator[bytes]:
    """Yield about `size` bytes of closed waves in moves of `step` mm: five rings a layer, 0.2 mm layers, E relative."""
    yield b"; fine curves\nG28\nG21\nG90\nM83\nM107\n"
    each = 0.45 * 0.2 * step / (math.pi * 1.75**2 / 4)
    rings = [b"".join(_ring(radius, step, each)) for radius in (20.0, 20.4, 20.8, 21.2, 21.6)]
    written, layer = 0, 0
    while layer == 0 or written < size:
        layer += 1
        piece = f";LAYER_CHANGE\n;Z:{0.2 * layer:.5g}\nG1 Z{0.2 * layer:.5g} F720\n".encode() + b"".join(rings)
        written += len(piece)
        yield piece
    yield b"G1 E-.8 F2100\nM104 S0\nM84\n"


def _ring(radius: float, step: float, each: float) -> Iterator[bytes]:
    def place(angle: float) -> tuple[float, float]:
        r = radius + 1.5 * math.sin(9.0 * angle)
        return 100.0 + r * math.cos(angle), 100.0 + r * math.sin(angle)

    x, y = place(0.0)
    yield f"G1 X{x:.3f} Y{y:.3f} F10800\n;TYPE:External perimeter\n;WIDTH:0.45\nG1 F1800\n".encode()
    angle = 0.0
    while angle < 2 * math.pi:
        slope = 13.5 * math.cos(9.0 * angle)
        angle += step / math.hypot(radius + 1.5 * math.sin(9.0 * angle), slope)
        x, y = place(angle)
        yield f"G1 X{x:.3f} Y{y:.3f} E{each:.5f}\n".replace("E0.", "E.").encode()
