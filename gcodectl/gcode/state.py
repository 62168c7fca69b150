"""The machine's modal state as one array of numbers, so that a kernel can carry it from chunk to chunk.

NaN is unknown for lengths and speeds, -1 for modes. The last entries are the row being made. Indices are constants:
kernels have no records.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Floats

X, Y, Z, E = 0, 1, 2, 3
"""Position in mm; E is the logical E in the file's own units."""
FEED = 4
"""mm/s, before M220."""
UNIT = 5
"""mm to the file's unit of length: 1 or 25.4."""
ABSOLUTE = 6
"""X, Y, Z: 1 absolute, 0 relative, -1 unknown."""
E_ABSOLUTE = 7
"""The same for E, before Klipper's rule that G91 makes E relative too."""
E_WORD = 8
"""The last of M82 (1) and M83 (0), -1 before either."""
PLANE, CENTER_ABSOLUTE = 9, 10
MOTION = 11
"""Code of the motion that a bare line continues, -1 unknown."""
SPEED, SPEED_SAVED, FLOW = 12, 13, 14
"""M220 and M221 as factors."""
VOLUMETRIC = 15
"""1 while M200 makes E a volume."""
ACCEL, TRAVEL, ACCEL_CAP, CORNER = 16, 17, 18, 19
ACCEL_NOW, TRAVEL_NOW = 20, 21
"""What the file asks for, under the cap of M201."""
TOOL = 22
LAYER, LAYER_Z, LAYER_STYLE, LAYER_NUMBER = 23, 24, 25, 26
"""Layer count, height of deposition it began at, which mark counts (0: none seen yet), Cura's last number."""
FEATURE, WIDTH, HEIGHT = 27, 28, 29
PLACES, E_PLACES = 30, 31
KIND, FLAGS, LENGTH, CENTER_A, CENTER_B, SWEEP, DE, DWELL = 32, 33, 34, 35, 36, 37, 38, 39
"""The row being made."""
SIZE = 40


def start_state() -> Floats:
    """Return the state before the first line: millimetres, absolute X Y Z; position, feed and E mode unknown."""
    state = np.zeros(SIZE)
    for unknown in (X, Y, Z, E, FEED, ACCEL, TRAVEL, ACCEL_CAP, CORNER, ACCEL_NOW, TRAVEL_NOW, WIDTH, HEIGHT, LAYER_Z):
        state[unknown] = math.nan
    for one in (UNIT, ABSOLUTE, SPEED, SPEED_SAVED, FLOW):
        state[one] = 1.0
    for none in (E_ABSOLUTE, E_WORD, MOTION, LAYER, PLACES, E_PLACES):
        state[none] = -1.0
    return state
