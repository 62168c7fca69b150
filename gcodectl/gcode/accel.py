"""Accelerations: M204 lines, so that firmware ramps where the plan does; as few of them as that takes.

    M204 P90      our own, before a row whose acceleration the plan ruled         Marlin, RepRapFirmware:  M204 P<a>
    G1 X.. E..                                                                    Klipper:                 M204 S<a>
    M204 P500     the file's own again, before a line that relies on it
    G1 X.. E..

Nothing is written while the file's own acceleration is in force and the plan keeps it. While ours is, these rely on the
file's own: moves on a path (Marlin takes P where E moves too, so travels only where we give them E; Klipper's S is for
all), whatever waits, homes or changes tools, and the file's own M204, M205 and their like, which may read it. Where the
file has set none, the machine's is the file's. Klipper's M204 P T and S: klippy/toolhead.py, cmd_M204; Marlin's
P, T, R: gcode/config/M200-M205.cpp and planner.cpp, where a block with E steps and a path takes P.
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Bytes, Floats, Ints
from gcodectl.config import Machine
from gcodectl.gcode.packed import ACCEL_IN, ACCEL_OUT, DISTANCE, FLAGS, KIND, OWN, PRINTING, RULED, E
from gcodectl.gcode.write import write_word_kernel
from gcodectl.jit import jit
from gcodectl.records import Flag, Kind, Moves

KNOWN, SETS_ACCEL = int(Flag.KNOWN), int(Flag.SETS_ACCEL)
LINE, ARC, TOOL, BARRIER = int(Kind.LINE), int(Kind.ARC), int(Kind.TOOL), int(Kind.BARRIER)
FILES = 0.0
"""carry[ACCEL_OUT] while the file's own acceleration is in force."""
DIGITS = 3


@jit
def needed_accel_kernel(floats: Floats, ints: Ints, writes: bool, klipper: bool, carry: Floats) -> float:
    """The acceleration to set before a row, mm/s^2; 0 where what is in force will do. `writes`: we give it its E."""
    needs = floats[RULED]
    if needs == 0.0:
        if carry[ACCEL_OUT] == FILES:
            return 0.0
        kind = ints[KIND]
        if kind in (LINE, ARC) and floats[DISTANCE] != 0.0:
            if klipper or writes or floats[E] != 0.0 or not ints[FLAGS] & KNOWN:
                needs = floats[OWN]
        elif kind in (TOOL, BARRIER) or ints[FLAGS] & SETS_ACCEL or (kind in (LINE, ARC) and not ints[FLAGS] & KNOWN):
            needs = carry[ACCEL_IN]
    return needs if needs != carry[ACCEL_OUT] else 0.0


@jit
def write_accel_kernel(out: Bytes, n: int, accel: float, klipper: bool, carry: Floats) -> int:
    """Write M204 without its line's end; returns where the next byte goes."""
    for byte in (77, 50, 48, 52):
        out[n] = byte
        n += 1
    carry[ACCEL_OUT] = accel
    return write_word_kernel(out, n, 83 if klipper else 80, accel, DIGITS)


@jit
def after_row_kernel(floats: Floats, ints: Ints, carry: Floats) -> None:
    """Keep what the file has in force after a row."""
    if ints[KIND] in (TOOL, BARRIER) or ints[FLAGS] & SETS_ACCEL:
        carry[ACCEL_OUT] = FILES
    carry[ACCEL_IN] = floats[PRINTING]


def own_acceleration(moves: Moves, machine: Machine) -> tuple[Floats, Floats]:
    """What the file, or the machine, has in force: for each move by what it is, and for printing moves, mm/s^2."""
    printing = np.where(np.isnan(moves.accel), machine.accel, moves.accel)
    travelling = np.where(np.isnan(moves.travel_accel), machine.travel_accel, moves.travel_accel)
    return np.where(moves.e > 0, printing, travelling), printing
