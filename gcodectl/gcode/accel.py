"""Accelerations: M204 lines, so that firmware ramps where the plan does; as few of them as that takes.

    M204 P91 T91      our own, before a row whose acceleration the plan ruled     Klipper:  M204 S91
    G1 X.. E..
    M204 P500 T500    the file's own again, before a line that relies on it       Klipper:  M204 S500
    G1 X.. E..

Nothing is written while the file's own accelerations are in force and the plan keeps them. While ours is, moves on a
path rely on the file's own, whatever waits, homes or changes tools does, and the file's own M204, M205 and their like,
which may read it. Where the file has set none, the machine's is the file's. Both P and T are set: a signal's line may
have no E at all, and is a travel to Marlin then; Klipper's S is for all moves. Sources: klippy/toolhead.py, cmd_M204;
Marlin gcode/config/M200-M205.cpp and planner.cpp, where a block with a path takes P if it has E steps, else T.
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Bytes, Floats, Ints
from gcodectl.config import Machine
from gcodectl.gcode.packed import (
    ACCEL_IN,
    ACCEL_OUT,
    DISTANCE,
    FLAGS,
    KIND,
    PRINTING,
    RULED,
    TRAVEL_IN,
    TRAVELLING,
)
from gcodectl.gcode.write import write_word_kernel
from gcodectl.jit import jit
from gcodectl.records import Flag, Kind, Moves

KNOWN, SETS_ACCEL = int(Flag.KNOWN), int(Flag.SETS_ACCEL)
LINE, ARC, TOOL, BARRIER = int(Kind.LINE), int(Kind.ARC), int(Kind.TOOL), int(Kind.BARRIER)
FILES = 0.0
"""carry[ACCEL_OUT] while the file's own accelerations are in force."""
DIGITS = 3


@jit
def needs_accel_kernel(floats: Floats, ints: Ints, carry: Floats) -> bool:
    """Whether a row needs another acceleration than what is in force."""
    if floats[RULED] > 0.0:
        return bool(floats[RULED] != carry[ACCEL_OUT])
    if carry[ACCEL_OUT] == FILES:
        return False
    moves = ints[KIND] in (LINE, ARC) and (floats[DISTANCE] != 0.0 or not ints[FLAGS] & KNOWN)
    return bool(moves or ints[KIND] in (TOOL, BARRIER) or ints[FLAGS] & SETS_ACCEL)


@jit
def write_accel_kernel(out: Bytes, n: int, floats: Floats, klipper: bool, carry: Floats) -> int:
    """Write the M204 that a row needs, without the line's end; returns where the next byte goes."""
    for byte in (77, 50, 48, 52):
        out[n] = byte
        n += 1
    carry[ACCEL_OUT] = floats[RULED] if floats[RULED] > 0.0 else FILES
    printing = floats[RULED] if floats[RULED] > 0.0 else carry[ACCEL_IN]
    travelling = floats[RULED] if floats[RULED] > 0.0 else carry[TRAVEL_IN]
    if klipper:
        return write_word_kernel(out, n, 83, printing, DIGITS)
    n = write_word_kernel(out, n, 80, printing, DIGITS)
    return write_word_kernel(out, n, 84, travelling, DIGITS)


@jit
def keep_accel_kernel(floats: Floats, carry: Floats) -> None:
    """Keep what the file has in force after a row."""
    carry[ACCEL_IN], carry[TRAVEL_IN] = floats[PRINTING], floats[TRAVELLING]


def own_acceleration(moves: Moves, machine: Machine) -> tuple[Floats, Floats]:
    """What the file, or the machine, has in force after each row, for roads and for travels, mm/s^2."""
    printing = np.where(np.isnan(moves.accel), machine.accel, moves.accel)
    return printing, np.where(np.isnan(moves.travel_accel), machine.travel_accel, moves.travel_accel)
