"""G0 to G3: from words to a move's end, path, E and speed; and whether the line may be written anew.

    line:  p0 ----------------> p1       arc:  p0 .-``-. p1   centre and sweep from arcs.py
           E: absolute E1 - E0, or relative E, times unit times M221

A move is KNOWN where its start, the E mode, E itself in absolute mode, and the feedrate are known, and nothing but X,
Y, Z, E, F (for arcs I, J, K, R, P) stands on the line. Of one that is not known, `e` is 0 where the E mode or the
logical E is unknown, and `length` is NaN where an axis that moves is. A line that only sets F, or ends where it
began, is NOTHING.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Floats
from gcodectl.gcode import state as at
from gcodectl.gcode.arcs import FINE, NO_CENTER, arc_kernel, radius_center_kernel
from gcodectl.gcode.codes import Mode
from gcodectl.gcode.marks import deposit_kernel
from gcodectl.gcode.modes import KLIPPER, MARLIN, REPRAPFIRMWARE, relative_e_kernel
from gcodectl.gcode.words import letter_bits
from gcodectl.jit import jit_inline, jit_lean
from gcodectl.records import Flag, Kind

ABSURD = 10
"""Problem number: a word too large to be a length or speed. Below it: arcs.py's."""
_LARGEST = 1e7
_UNWRITABLE = sum(Mode)  # a mode set on the line would be lost with it: `G91 G1 X1`
_NOTHING, _LINE, _ARC, _BARRIER = int(Kind.NOTHING), int(Kind.LINE), int(Kind.ARC), int(Kind.BARRIER)
_KNOWN, _REL, _REL_E = int(Flag.KNOWN), int(Flag.RELATIVE_XYZ), int(Flag.RELATIVE_E)
_INCHES, _G0 = int(Flag.INCHES), int(Flag.G0)
_E, _F, _H, _I, _P, _R, _S, _X = 4, 5, 7, 8, 15, 17, 18, 23
_OF_ARCS = letter_bits("IJKPR")
_FOREIGN = letter_bits("ABCDGHLMOQSTUVW")
_FOREIGN_AXES = letter_bits("ABCUVW")
_HAS_E = letter_bits("E")
_FIRST, _SECOND = np.array([0, 2, 1]), np.array([1, 0, 2])


@jit_inline
def flags_kernel(state: Floats, dialect: int) -> int:
    """Return the flags that the modes in force give a row, KNOWN where they and the position are known."""
    relative = relative_e_kernel(state, dialect)
    flags = _REL if state[at.ABSOLUTE] == 0 else 0
    flags |= _REL_E if relative == 1 else 0
    flags |= _INCHES if state[at.UNIT] != 1.0 else 0
    unknown = state[at.X] + state[at.Y] + state[at.Z] + state[at.FEED] + (state[at.E] if relative == 0 else 0.0)
    if relative >= 0 and state[at.ABSOLUTE] >= 0 and not np.isnan(unknown):
        flags |= _KNOWN
    return flags


@jit_inline
def extrude_kernel(word: float, state: Floats, dialect: int) -> float:
    """Move the logical E by the word; returns E's way in mm (mm^3 where volumetric), NaN where unknown."""
    relative = relative_e_kernel(state, dialect)
    delta = word if relative == 1 else (word - state[at.E] if relative == 0 else np.nan)
    state[at.E] = state[at.E] + word if relative == 1 else (word if relative == 0 else np.nan)
    unit = state[at.UNIT]
    if state[at.VOLUMETRIC] == 1:
        unit *= unit * unit
    return float(delta * unit * state[at.FLOW])


@jit_inline
def foreign_kernel(present: int, modes: int, arc: bool) -> bool:
    """Tell whether the line has a word that a rewritten line could not keep."""
    return (modes & _UNWRITABLE) != 0 or (present & (_FOREIGN if arc else _FOREIGN | _OF_ARCS)) != 0


@jit_inline
def target_kernel(words: Floats, p0: Floats, state: Floats) -> float:
    """Move X, Y, Z by their words; returns the straight distance, NaN where it is unknown."""
    square = 0.0
    for axis in range(3):
        word = words[_X + axis]
        if not np.isnan(word):
            end = word * state[at.UNIT]
            if state[at.ABSOLUTE] != 1:
                end = p0[axis] + end if state[at.ABSOLUTE] == 0 else np.nan
            state[axis] = end
            square += (end - p0[axis]) ** 2
    return math.sqrt(square)


@jit_lean
def bend_kernel(words: Floats, p0: Floats, clockwise: bool, state: Floats, dialect: int) -> int:
    """Make the row an arc from `p0` to the position in `state`; returns a problem number of arcs.py."""
    plane = int(state[at.PLANE])
    first, second = _FIRST[plane], _SECOND[plane]
    a0, b0, a1, b1 = p0[first], p0[second], state[first], state[second]
    # Klipper names the axes of G18 X and Z, not Z and X: its clockwise is the other way there (gcode_arcs.py).
    ccw = clockwise if dialect == KLIPPER and plane == 1 else not clockwise
    problem = FINE
    if not np.isnan(words[_R]):
        ca, cb, problem = radius_center_kernel(a0, b0, a1, b1, words[_R] * state[at.UNIT], ccw)
    else:
        ia, ib = words[_I + first], words[_I + second]
        if np.isnan(ia) and np.isnan(ib):
            return NO_CENTER
        base_a, base_b = (0.0, 0.0) if state[at.CENTER_ABSOLUTE] == 1 else (a0, b0)
        ca = a0 if np.isnan(ia) and state[at.CENTER_ABSOLUTE] == 1 else base_a
        cb = b0 if np.isnan(ib) and state[at.CENTER_ABSOLUTE] == 1 else base_b
        ca += 0.0 if np.isnan(ia) else ia * state[at.UNIT]
        cb += 0.0 if np.isnan(ib) else ib * state[at.UNIT]
    state[at.CENTER_A], state[at.CENTER_B] = ca, cb
    if np.isnan(a0 + b0 + a1 + b1):
        state[at.SWEEP], state[at.LENGTH] = np.nan, np.nan
        return FINE
    third = 3 - first - second
    rise = 0.0 if np.isnan(words[_X + third]) else state[third] - p0[third]
    turns = math.floor(words[_P]) if dialect == MARLIN and words[_P] >= 1 else 0.0
    if problem == FINE:
        state[at.SWEEP], state[at.LENGTH], problem = arc_kernel(a0, b0, a1, b1, ca, cb, rise, ccw, turns)
    return problem


@jit_inline
def absurd_kernel(words: Floats, present: int) -> bool:
    """Tell whether a coordinate, offset or speed is too large to be meant."""
    absurd: bool = abs(words[_E]) > _LARGEST or abs(words[_F]) > _LARGEST
    for axis in range(3):
        absurd |= abs(words[_X + axis]) > _LARGEST
    if present & _OF_ARCS:
        for axis in range(3):
            absurd |= abs(words[_I + axis]) > _LARGEST
        absurd |= abs(words[_R]) > _LARGEST
    return absurd


@jit_inline
def motion_kernel(code: int, words: Floats, present: int, modes: int, p0: Floats, state: Floats, dialect: int) -> int:
    """Carry out G0-G3 from `p0`: the row and the new position into `state`; returns a problem number."""
    if absurd_kernel(words, present):
        return ABSURD
    arc = code >= 20
    if words[_F] > 0:
        state[at.FEED] = words[_F] * state[at.UNIT] / 60
    distance = target_kernel(words, p0, state)
    state[at.LENGTH] = distance
    delta = 0.0 if not present & _HAS_E else extrude_kernel(words[_E], state, dialect)
    state[at.DE] = 0.0 if np.isnan(delta) else delta
    flags = flags_kernel(state, dialect) | (_G0 if code == 0 else 0)
    if np.isnan(p0[0] + p0[1] + p0[2] + delta) or foreign_kernel(present, modes, arc):
        flags &= ~_KNOWN
    state[at.FLAGS] = flags
    if dialect == REPRAPFIRMWARE and (words[_H] > 0 or 1 <= words[_S] <= 3):  # runs until an endstop says stop
        state[at.KIND] = _BARRIER
        state[at.X], state[at.Y], state[at.Z] = np.nan, np.nan, np.nan
        state[at.LENGTH], state[at.FLAGS] = np.nan, flags & ~_KNOWN
        return FINE
    if arc:
        problem = bend_kernel(words, p0, code == 20, state, dialect)
        if problem != FINE:
            return problem
        state[at.KIND] = _ARC
    elif present & _FOREIGN_AXES or distance != 0 or state[at.DE] != 0 or np.isnan(delta):
        state[at.KIND] = _LINE
    if state[at.DE] > 0 and state[at.LENGTH] > 0:
        deposit_kernel(state[at.Z], state)
    return FINE
