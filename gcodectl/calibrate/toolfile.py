"""Fab@Home tool files: `KEY value // remark` lines, and what they say in the twelve parameters.

    PUSHOUT [s]            the plunger moves PUSHOUT x 5000 steps at once, then the path sets off:
                           pushoutspeed = 5000 steps/s x pitch x barrel, pushouttime = acceldelay = PUSHOUT
    SUCKBACK [s]           spread over the last SUCKBACK seconds of the path, as many steps a second, back:
                           pullbackspeed = pushoutspeed, pullbacktime = SUCKBACK
    SUCKBACKDELAY [s]      shifts it later: deceldelay = SUCKBACK - SUCKBACKDELAY
    DEPOSITIONRATE         mm of plunger per mm of path; inputspeed = DEPOSITIONRATE x PATHSPEED x barrel
    PATHSPEED [mm/s]       outputspeed
    TIPDIAM, PATHWIDTH, PATHHEIGHT [mm], BARRELDIAM [mm], MOTOR (its last number: mm a step, the pitch)

The files know no accelerations: they stay unknown. Nor do they name the material: their own name does,
`10ccGreenTaperLeft-FabEpoxy.tool`, and with it the tip's kind. A colour is no other material: black, clear, green,
white and a mason's silicone are all silicone, or what is left out of an evaluation would still be in it.

Odd are: no material in the name; a deposit that is not between a third and three times width x height x length (ink
jets, melt heads); a description that names another tip. The first two are refused, the last is said.

Source: the Fab@Home model 1 program (BSD), which gives PUSHOUT its meaning (5000 steps/s, "held over").
"""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

from gcodectl.calibrate.calibration import Attributes, Calibration, Parameters
from gcodectl.errors import InputError

STEPS_PER_SECOND = 5000.0
NEEDED = ("TIPDIAM", "PATHWIDTH", "PATHHEIGHT", "PUSHOUT", "SUCKBACK", "DEPOSITIONRATE", "PATHSPEED", "BARRELDIAM")
BARREL_10CC = 15.8
"""mm"""
MOST_OFF = 3.0
"""A deposit further off the road's own volume than this factor is no paste's."""
SAME = {"dp460 ns": "dp460 ns epoxy"}
"""One material under two names."""
LARGEST = 1_000_000
"""Bytes: no tool file is longer."""
_UNITS = {"PUSHOUT": ("s", "sec"), "SUCKBACK": ("s", "sec"), "SUCKBACKDELAY": ("s", "sec")}
_LOOKS = ("black", "clear", "green", "white", "mason")
_TIP_COLOURS = ("amber", "blue", "gray", "green", "olive", "pink", "red")


@dataclasses.dataclass(frozen=True)
class ToolFile:
    """A tool file's calibration, and what is odd about it."""

    calibration: Calibration
    odd: tuple[str, ...] = ()


def read_tool(path: Path, material: str | None = None) -> ToolFile:
    """Read a tool file; `material` names what its own name does not. Raises InputError that says what is wrong."""
    try:
        if path.stat().st_size > LARGEST:
            raise InputError("is too large for a tool file", source=str(path))
        text = path.read_bytes().decode("utf-8", errors="replace")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", source=str(path)) from error
    table = _table(text)
    missing = [key for key in (*NEEDED, "MOTOR") if key not in table]
    if len(missing) > len(NEEDED) // 2:
        raise InputError("is no Fab@Home tool file: it has no PUSHOUT, SUCKBACK, ... lines", source=str(path))
    if missing:
        raise InputError(f"has no {', '.join(missing)} line", source=str(path))
    name, nozzle = _named(path.stem)
    number = {key: _number(path, table, key) for key in NEEDED}
    pitch = _number(path, table, "MOTOR", last=True)
    delay = _number(path, table, "SUCKBACKDELAY") if "SUCKBACKDELAY" in table else 0.0
    if material is None and not name:
        raise InputError("its name has no material in it; name it with --material", source=str(path))
    positive = {key: value for key, value in number.items() if key not in ("PUSHOUT", "SUCKBACK")}
    for key, value in {**positive, "MOTOR": pitch}.items():
        if not value > 0:
            raise InputError(f"{key} is {value:g}; it must be positive", line=table[key][0], source=str(path))
    area = math.pi * number["BARRELDIAM"] ** 2 / 4
    off = number["DEPOSITIONRATE"] * area / (number["PATHWIDTH"] * number["PATHHEIGHT"])
    if not 1 / MOST_OFF < off < MOST_OFF:
        raise InputError(
            f"is no paste's: it deposits {off:.3g} times the road's width x height x length", source=str(path)
        )
    if number["PUSHOUT"] < 0 or number["SUCKBACK"] < 0:
        raise InputError("PUSHOUT and SUCKBACK must not be negative", source=str(path))
    attributes = Attributes(
        material or name, tool="10cc syringe" if abs(number["BARRELDIAM"] - BARREL_10CC) < 0.1 else "syringe",
        nozzle_type=nozzle,
        nozzle_diameter=number["TIPDIAM"], path_width=number["PATHWIDTH"], path_height=number["PATHHEIGHT"],
    )  # fmt: skip
    push = STEPS_PER_SECOND * pitch * area
    parameters = Parameters(
        acceldelay=number["PUSHOUT"], pushoutspeed=push, pushouttime=number["PUSHOUT"],
        inputspeed=number["DEPOSITIONRATE"] * number["PATHSPEED"] * area, outputspeed=number["PATHSPEED"],
        deceldelay=number["SUCKBACK"] - max(delay, 0.0), pullbackspeed=push, pullbacktime=number["SUCKBACK"],
    )  # fmt: skip
    return ToolFile(Calibration(attributes, parameters, path.name), _odd(path.stem, table, number["TIPDIAM"]))


def _table(text: str) -> dict[str, tuple[int, str]]:
    """Return what stands behind each key, with its line; remarks begin with // or ;."""
    found: dict[str, tuple[int, str]] = {}
    for line, raw in enumerate(text.splitlines(), 1):
        words = re.split(r"//|;", raw, maxsplit=1)[0].split(None, 1)
        if len(words) == 2 and re.fullmatch(r"[A-Z]+", words[0]):
            found.setdefault(words[0], (line, words[1].strip()))
    return found


def _number(path: Path, table: dict[str, tuple[int, str]], key: str, *, last: bool = False) -> float:
    line, text = table[key]
    words = text.split()
    word, unit = (words[-1], "") if last else (words[0], " ".join(words[1:]))
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{key} is no number", line=line, text=text, source=str(path))
    known = (*_UNITS.get(key, ("mm", "mm/s")), "")
    if unit not in known:
        raise InputError(f"{key} is in {unit!r}, not {known[0]}: please convert", line=line, source=str(path))
    return value


def _named(stem: str) -> tuple[str, str | None]:
    """Return the material and the tip's kind that a file's name tells."""
    parts = [one.strip() for one in re.split(r"\s*-\s*", stem)]
    tips = [one for one in parts if re.search(r"taper|needle|precision", one, re.IGNORECASE)]
    tip = tips[0] if tips else ""
    rest = [one for one in parts if one != tip]
    nozzle = "needle" if "needle" in tip.lower() else "taper" if "taper" in tip.lower() else None
    own = rest[0] if rest else re.sub(r"^.*(?:taper|needle|precision)", "", tip, flags=re.IGNORECASE)
    spaced = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[a-z])(?=\d)|_", " ", own).lower().split()
    name = " ".join(word for word in spaced if word not in (*_LOOKS, "left", "right"))
    return SAME.get(name, name), nozzle


def _odd(stem: str, table: dict[str, tuple[int, str]], tip: float) -> tuple[str, ...]:
    said = table.get("DESCRIPTION", (0, ""))[1].lower()
    odd = []
    sizes = [float(one) for one in re.findall(r"\((\d*\.\d+)\s*(?:mm)?", said)]
    if sizes and all(abs(one - tip) > 0.02 for one in sizes):
        odd.append(f"its description speaks of a {sizes[0]:g} mm tip, and TIPDIAM is {tip:g} mm")
    told = {one for one in _TIP_COLOURS if re.search(rf"\b{one}\b", said)}
    named = {one for one in _TIP_COLOURS if re.search(rf"{one}(?:taper|needle|precision)", stem.lower())}
    if named and told and not named & told:
        odd.append(f"its description speaks of a {'/'.join(sorted(told))} tip, and its name of a {min(named)} one")
    return tuple(odd)
