"""Slicers' marks in comments: layers, features, widths and heights. They label; nothing depends on them.

    ;TYPE:External perimeter    ; FEATURE: Outer wall      feature (PrusaSlicer, SuperSlicer, Orca, Cura; Bambu)
    ;WIDTH:0.45                 ; LINE_WIDTH: 0.45         ;HEIGHT:0.2    ; LAYER_HEIGHT: 0.2
    ;LAYER_CHANGE               ; CHANGE_LAYER             ;LAYER:3       (Cura)

Layers are counted, from 0: by the first of the two styles that the file uses; before any mark, by the height of
deposition: a new layer where a move deposits more than 0.05 mm above or below where the layer began.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Bytes, Floats, Ints
from gcodectl.gcode import state as at
from gcodectl.gcode.dialects import FEATURES, name_hash
from gcodectl.gcode.names import find_kernel, hash_kernel, text_hash_kernel
from gcodectl.gcode.numbers import number_kernel
from gcodectl.gcode.words import spaces_kernel
from gcodectl.jit import jit_lean

STEP = 0.05
"""mm of height that make a new layer where the file has no marks."""

_TYPE, _FEATURE = name_hash("TYPE"), name_hash("FEATURE")
_WIDTH, _LINE_WIDTH = name_hash("WIDTH"), name_hash("LINE_WIDTH")
_HEIGHT, _LAYER_HEIGHT = name_hash("HEIGHT"), name_hash("LAYER_HEIGHT")
_LAYER, _LAYER_CHANGE, _CHANGE_LAYER = name_hash("LAYER"), name_hash("LAYER_CHANGE"), name_hash("CHANGE_LAYER")
_OTHER = FEATURES.index("other")


@jit_lean
def mark_kernel(text: Bytes, i: int, end: int, features: Ints, state: Floats) -> None:
    """Take in the mark, if it is one, of the comment whose `;` stands at `i`."""
    i = spaces_kernel(text, i + 1, end)
    if i >= end or not 65 <= text[i] <= 90:
        return
    key, i = hash_kernel(text, i, end)
    colon = i < end and text[i] == 58
    if not colon:
        rest = spaces_kernel(text, i, end)
        if (key in (_LAYER_CHANGE, _CHANGE_LAYER)) and (rest >= end or text[rest] == 10 or text[rest] == 13):
            layer_mark_kernel(1, 0.0, state)
        return
    if key in (_TYPE, _FEATURE):
        found = find_kernel(text_hash_kernel(text, i + 1, end), features)
        state[at.FEATURE] = found if found else _OTHER
        return
    value, _, _, is_number = number_kernel(text, spaces_kernel(text, i + 1, end), end, False)
    if is_number:
        if key in (_WIDTH, _LINE_WIDTH):
            state[at.WIDTH] = value
        elif key in (_HEIGHT, _LAYER_HEIGHT):
            state[at.HEIGHT] = value
        elif key == _LAYER:
            layer_mark_kernel(2, value, state)


@jit_lean
def layer_mark_kernel(style: int, number: float, state: Floats) -> None:
    """Count a layer mark of `style` 1 (a change) or 2 (a number), where that is the file's style."""
    if state[at.LAYER_STYLE] == 0:
        state[at.LAYER_STYLE] = style
        state[at.LAYER] = -1
        state[at.LAYER_NUMBER] = math.nan
    if state[at.LAYER_STYLE] == style and not (style == 2 and number == state[at.LAYER_NUMBER]):
        state[at.LAYER] += 1
        state[at.LAYER_NUMBER] = number


@jit_lean
def deposit_kernel(z: float, state: Floats) -> None:
    """Count a layer by the height `z` of a move that deposits, where the file has shown no marks."""
    if state[at.LAYER_STYLE] == 0 and not np.isnan(z) and not abs(z - state[at.LAYER_Z]) <= STEP:
        state[at.LAYER] += 1
        state[at.LAYER_Z] = z
