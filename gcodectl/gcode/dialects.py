"""Tables of what the firmwares and slicers write: commands by what they do, Klipper's names, the slicers' features.

Sources: Marlin's gcode documentation, Klipper's docs/G-Codes.md, RepRapFirmware's G-code dictionary, Prusa's and
Bambu's additions as their slicers write them. What is in no table is taken for a macro: it may move.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Ints
from gcodectl.gcode.codes import M_BASE

DIALECT_NUMBER = {"marlin": 0, "klipper": 1, "reprapfirmware": 2}


class Effect(IntEnum):
    """What a command without a rule of its own leaves known."""

    MOVES = 0
    """It may move: the position is lost, the modes stay (G29, unknown commands)."""
    HARMLESS = 1
    """No motion, no waiting."""
    WAITS = 2
    """The machine comes to rest and stays where it is (M109, M400)."""
    PAUSES = 3
    """A pause or filament change that returns: X and Y are learned anew, the height is where it was."""
    FORGETS = 4
    """Position, E, feed and modes are lost: loops, conditions, restored states."""
    REFUSED = 5
    """It changes what later coordinates mean in ways that are not followed."""
    CYCLE = 6
    """Refused where it has coordinates (a canned cycle), else as MOVES (Prusa's G80, G81)."""


_HARMLESS_M = (
    "3-5 7-11 17 20-24 27 29 31-33 36 38-43 48 49 70-75 77 78 80-83 85-87 92 93 104-108 110 111 113-115 117-120 "
    "122 123 126 127 134-136 140-145 149 150 154-156 163-166 200-205 207-209 211 217 220 221 240 250 255 256 260 261 "
    "280-283 290-292 300-302 304-309 350 351 355 380 381 403 404-409 412-415 420-423 425 430 431 471 486 500 503 504 "
    "505 524 540 550-560 562-564 566-576 578 580-582 584 586-589 591-593 595 596 603 605 665 666 672 710 851 860-869 "
    "871 876 900 905-920 928-930 951 960 973 975 981-984 991 993-995 1002 1003 1006"
)
_WAITS = {"M": "2 30 109 116 190 191 226 303 400 577", "G": ""}
_PAUSES_M = "0 1 25 76 125 226 600-602 701 702"
_FORGETS_M = "98 99 121 501 502 622 623 808 112 999"
_HARMLESS_G = "40 60 64 94 97 17-19 20 21 90 91"
_REFUSED_G = "7 16 41-42 51 68 93 95 96"
_CYCLES_G = "70-74 76 80-89"


def _numbers(text: str) -> list[int]:
    ranges = [part.partition("-") for part in text.split()]
    return [number for low, _, high in ranges for number in range(int(low), int(high or low) + 1)]


def _effects() -> NDArray[np.int8]:
    """Return Effect by code, up to M1999; codes with a digit after the point may move unless listed."""
    table = np.full(M_BASE + 20_000, int(Effect.MOVES), dtype=np.int8)
    rows = (
        (M_BASE, _HARMLESS_M, Effect.HARMLESS),
        (M_BASE, _WAITS["M"], Effect.WAITS),
        (M_BASE, _PAUSES_M, Effect.PAUSES),
        (M_BASE, _FORGETS_M, Effect.FORGETS),
        (0, _HARMLESS_G, Effect.HARMLESS),
        (0, _REFUSED_G, Effect.REFUSED),
        (0, _CYCLES_G, Effect.CYCLE),
    )
    for base, text, effect in rows:
        for number in _numbers(text):
            table[base + 10 * number] = int(effect)
    for dotted in (901, 911, *range(M_BASE + 8620, M_BASE + 8630), M_BASE + 732, M_BASE + 2012, 291, 292):
        table[dotted] = int(Effect.HARMLESS)
    for dotted in (411, 421, 51):
        table[dotted] = int(Effect.REFUSED if dotted != 51 else Effect.MOVES)
    table[M_BASE + 6221] = int(Effect.FORGETS)
    return table


EFFECTS = _effects()

_TEXT_M = "16 20 23 28 30 32-34 36 38 98 117 118 291 409 471 486 550-552 560 587-589 620-623 862 928-930 997 1002"
TEXT_COMMANDS = np.zeros(2000, dtype=np.bool_)
"""M codes by number whose argument is text: no word is read from it."""
TEXT_COMMANDS[_numbers(_TEXT_M)] = True

_HARMLESS_NAMES = (
    "EXCLUDE_OBJECT EXCLUDE_OBJECT_START EXCLUDE_OBJECT_END EXCLUDE_OBJECT_DEFINE SET_PRESSURE_ADVANCE "
    "SET_PRINT_STATS_INFO SET_FAN_SPEED SET_HEATER_TEMPERATURE SET_LED SET_PIN SET_SERVO SET_DISPLAY_TEXT "
    "SET_TEMPERATURE_FAN_TARGET SET_IDLE_TIMEOUT SET_FILAMENT_SENSOR QUERY_FILAMENT_SENSOR SET_RETRACTION "
    "GET_RETRACTION GET_POSITION STATUS RESPOND TURN_OFF_HEATERS SET_INPUT_SHAPER UPDATE_DELAYED_GCODE "
    "SET_GCODE_VARIABLE SAVE_VARIABLE HELP QUERY_ENDSTOPS SET_TMC_CURRENT INIT_TMC DUMP_TMC SET_TMC_FIELD "
    "SET_DISPLAY_GROUP SET_SMOOTH_TIME TIMELAPSE_RENDER HYPERLAPSE"
)
_RETURNING_NAMES = ("TIMELAPSE_TAKE_FRAME", "PAUSE", "RESUME")

FEATURES = (
    "",
    "custom",
    "skirt",
    "external perimeter",
    "perimeter",
    "overhang perimeter",
    "thin wall",
    "infill",
    "solid infill",
    "top solid infill",
    "bridge infill",
    "gap fill",
    "ironing",
    "support",
    "support interface",
    "wipe tower",
    "travel",
    "other",
)
"""What a move is part of, by the slicer's marks: 0 is unmarked; `other` is a mark in no table."""

_SPELLINGS = {
    "custom": "Custom|Mill|Machine start|Machine end",
    "skirt": "Skirt|Skirt/Brim|Brim|Raft",
    "external perimeter": "External perimeter|Outer wall|WALL-OUTER|Outer perimeter",
    "perimeter": "Perimeter|Internal perimeter|Inner wall|WALL-INNER|Inner perimeter",
    "overhang perimeter": "Overhang perimeter|Overhang wall",
    "thin wall": "Thin wall",
    "infill": "Internal infill|Infill|Sparse infill|FILL",
    "solid infill": "Solid infill|Internal solid infill|Bottom surface|SKIN|Floating vertical shell",
    "top solid infill": "Top solid infill|Top surface",
    "bridge infill": "Bridge infill|Internal bridge infill|Bridge|Internal Bridge",
    "gap fill": "Gap fill|Gap infill",
    "ironing": "Ironing",
    "support": "Support material|Support|Support transition",
    "support interface": "Support material interface|Support interface|SUPPORT-INTERFACE",
    "wipe tower": "Wipe tower|Prime tower|PRIME-TOWER|Flush",
    "travel": "Travel",
}


def name_hash(name: str) -> int:
    """Return the FNV-1a hash (32 bit) of a name in capitals, as the kernels compute it."""
    value = 2166136261
    for byte in name.upper().encode():
        value = ((value ^ byte) * 16777619) & 0xFFFFFFFF
    return value


def _pairs(names: dict[str, int]) -> Ints:
    table = np.array([[name_hash(name), number] for name, number in names.items()], dtype=np.int64)
    assert len(set(table[:, 0])) == len(names), "two names share a hash"
    return table


NAME_HASHES = _pairs(dict.fromkeys(_HARMLESS_NAMES.split(), 1) | dict.fromkeys(_RETURNING_NAMES, 2))
"""Pairs (hash of an extended command's name, 1 where it moves nothing, 2 where it returns)."""
FEATURE_HASHES = _pairs(
    {spelling: FEATURES.index(name) for name, text in _SPELLINGS.items() for spelling in text.split("|")}
)
"""Pairs (hash of a slicer's spelling, index into FEATURES)."""
