"""Why a line is refused, in a sentence that says what to do."""

from __future__ import annotations

from gcodectl.errors import InputError
from gcodectl.gcode import arcs, commands, motions
from gcodectl.gcode.codes import command_name

_REMEDY = "; with --pass-unknown the line is passed through and the machine is taken to stop there"

_REASONS = {
    arcs.NO_CENTER: "the arc has no centre: it needs I, J or K, or an R and an end that is not its start",
    arcs.RADII_DIFFER: "the arc's start and end are not at the same distance from its centre",
    arcs.TOO_FAR: "the arc's end is farther from its start than R can reach",
    motions.ABSURD: "a number on the line is too large to be meant",
    commands.CYCLE: "canned cycles are not followed",
    commands.NO_MOTION: "the line has coordinates, but no G0, G1, G2 or G3 is in force",
}
_REFUSED = {
    "G7": "lathe diameter mode is not followed",
    "G16": "polar coordinates are not followed",
    "G41": "cutter compensation is not followed",
    "G41.1": "cutter compensation is not followed",
    "G42": "cutter compensation is not followed",
    "G42.1": "cutter compensation is not followed",
    "G51": "scaling is not followed",
    "G68": "a rotated coordinate system is not followed",
    "G93": "inverse-time feed is not followed",
    "G95": "feed per revolution is not followed",
    "G96": "constant surface speed is not followed",
}
_STRAY = (
    (b"\r", "a carriage return stands inside the line; save the file with LF or CRLF line ends"),
    (b"*", "the checksum does not match the line, or a character stands behind it; was the file damaged?"),
    (b"#", "numbered parameters are not followed; let the program that wrote it expand them"),
    (b"{", "expressions are not followed here; write the number"),
    (b"[", "expressions are not followed; let the program that wrote it expand them"),
)


def stray_reason(text: bytes) -> str:
    """Return what is wrong with the text of a line that the parser found unsafe."""
    body = text.rstrip(b"\r\n")
    if b"\r" not in body:
        body = body.partition(b";")[0]
    if b"\0" in body:
        return "this is binary data, not G-code"
    for sign, reason in _STRAY:
        if sign in body:
            return reason
    if body.lstrip(b" \tN0123456789n")[:1].upper() == b"O":
        return "subroutines and loops (O-words) are not followed; let the program that wrote it expand them"
    return "the line cannot be read as G-code: a stray character, a word without its number, or two opposite modes"


def refusal(problem: int, code: int, text: bytes, line: int, source: str) -> InputError:
    """Return the error for a problem number of the kernels, with line, text, reason and remedy."""
    if problem == commands.UNSAFE:
        reason = stray_reason(text)
    elif problem == commands.REFUSED:
        reason = _REFUSED[command_name(code)]
    else:
        reason = _REASONS[problem]
    return InputError(reason + _REMEDY, line=line, text=text, source=source)
