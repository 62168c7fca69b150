#!/usr/bin/env python3
"""Make the test files of this folder again: shapes as STL out of a few lines, sliced by PrusaSlicer, headless.

    python tests/data/make_parts.py [FOLDER]

The printer is a syringe of 15.8 mm with a 0.84 mm tip at 10 mm/s. Needs `prusa-slicer` (Debian: prusa-slicer); the
files that are written by hand are not touched.
"""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
from pathlib import Path

Point = tuple[float, float]

SYRINGE = {
    "gcode-flavor": "marlin",
    "filament-diameter": "15.8",
    "nozzle-diameter": "0.84",
    "layer-height": "0.6",
    "first-layer-height": "0.6",
    "extrusion-width": "0.9",
    "first-layer-extrusion-width": "0.9",
    "perimeter-extrusion-width": "0.9",
    "external-perimeter-extrusion-width": "0.9",
    "infill-extrusion-width": "0.9",
    "solid-infill-extrusion-width": "0.9",
    "top-infill-extrusion-width": "0.9",
    "perimeters": "1",
    "perimeter-speed": "10",
    "external-perimeter-speed": "10",
    "small-perimeter-speed": "10",
    "infill-speed": "10",
    "solid-infill-speed": "10",
    "top-solid-infill-speed": "10",
    "gap-fill-speed": "8",
    "first-layer-speed": "8",
    "travel-speed": "40",
    "max-print-speed": "10",
    "top-solid-layers": "0",
    "bottom-solid-layers": "1",
    "fill-density": "15%",
    "retract-length": "0.02",
    "retract-speed": "2",
    "retract-lift": "0",
    "temperature": "0",
    "first-layer-temperature": "0",
    "bed-temperature": "0",
    "first-layer-bed-temperature": "0",
    "min-print-speed": "5",
    "skirts": "0",
    "use-relative-e-distances": "0",
}
FLAGS = ("no-cooling",)

PARTS: dict[str, tuple[str, dict[str, str], tuple[str, ...]]] = {
    "box_abs.gcode": ("box", {}, ()),
    "star_rel.gcode": (
        "star",
        {"retract-lift": "0.3", "layer-gcode": "G92 E0", "use-relative-e-distances": "1", "retract-before-wipe": "0%"},
        ("wipe",),
    ),
    "box_fwretract.gcode": ("box", {"layer-gcode": "G92 E0"}, ("use-firmware-retraction", "use-relative-e-distances")),
    "box_two_tools.gcode": (
        "box",
        {
            "filament-diameter": "15.8,15.8",
            "nozzle-diameter": "0.84,0.84",
            "retract-length-toolchange": "0.05,0.05",
            "infill-extruder": "2",
            "solid-infill-extruder": "2",
        },
        (),
    ),
}


def box(side: float = 12.0) -> list[Point]:
    """A square."""
    return [(0, 0), (side, 0), (side, side), (0, side)]


def star(points: int = 5, outer: float = 9.0, inner: float = 4.5) -> list[Point]:
    """A star with `points` arms."""
    radii = [outer if k % 2 == 0 else inner for k in range(2 * points)]
    angles = [math.pi * k / points for k in range(2 * points)]
    return [(r * math.cos(a), r * math.sin(a)) for r, a in zip(radii, angles, strict=True)]


SHAPES = {"box": box, "star": star}


def stl(outline: list[Point], height: float) -> str:
    """A prism over an outline that can be seen whole from (its mean), as ASCII STL."""
    n = len(outline)
    middle = (sum(x for x, _ in outline) / n, sum(y for _, y in outline) / n)
    faces = []
    for k in range(n):
        a, b = outline[k], outline[(k + 1) % n]
        faces.append(((*middle, height), (*a, height), (*b, height)))
        faces.append(((*middle, 0.0), (*b, 0.0), (*a, 0.0)))
        faces.append(((*a, 0.0), (*b, 0.0), (*b, height)))
        faces.append(((*a, 0.0), (*b, height), (*a, height)))
    lines = ["solid part"]
    for face in faces:
        corners = "\n".join("vertex " + " ".join(f"{c:.6f}" for c in corner) for corner in face)
        lines.append(f"facet normal 0 0 0\nouter loop\n{corners}\nendloop\nendfacet")
    return "\n".join([*lines, "endsolid part", ""])


def slicer_words(settings: dict[str, str], flags: tuple[str, ...] = ()) -> list[str]:
    """Return the options of PrusaSlicer's command line."""
    given = [f"--{key}={value}" for key, value in {**SYRINGE, **settings}.items()]
    return [*given, *(f"--{flag}" for flag in (*FLAGS, *flags))]


def slice_part(outline: list[Point], words: list[str], output: Path, height: float = 1.8) -> None:
    """Slice a prism of `height` over `outline` into `output`."""
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "part.stl"
        model.write_text(stl(outline, height))
        command = ["prusa-slicer", "--export-gcode", "--output", str(output), *words, "--center=60,60", str(model)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def main() -> None:
    """Slice every part."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    for name, (shape, settings, flags) in PARTS.items():
        slice_part(SHAPES[shape](), slicer_words(settings, flags), (folder / name).resolve())
        print(f"{name}: {(folder / name).stat().st_size} bytes")


if __name__ == "__main__":
    main()
