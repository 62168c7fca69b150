"""Hypothesis strategies: words, lines and files of G-code as slicers, people and mills write them."""

from __future__ import annotations

from hypothesis import strategies as st

Words = dict[str, str]


def numbers(limit: int = 500, places: int = 5) -> st.SearchStrategy[str]:
    """Numbers as text: `12`, `-.5`, `+3.`, `0.00012`."""
    whole = st.integers(0, limit).map(str)
    fraction = st.text("0123456789", min_size=1, max_size=places)
    forms = st.one_of(
        whole,
        st.builds("{}.{}".format, whole, fraction),
        fraction.map(".{}".format),
        whole.map("{}.".format),
    )
    return st.builds("{}{}".format, st.sampled_from(["", "", "-", "+"]), forms)


def words(letters: str = "XYZE", least: int = 0) -> st.SearchStrategy[Words]:
    """Words by letter, with their numbers as text."""
    return st.dictionaries(st.sampled_from(letters), numbers(), min_size=least)


@st.composite
def spelled(draw: st.DrawFn, command: str, found: Words, comments: bool = True) -> str:
    """One line that says `command` with `found`, in any of the spellings that mean the same."""
    parts = [command, *(letter + number for letter, number in found.items())]
    if draw(st.booleans()):
        parts = [part.lower() for part in parts]
    gap = draw(st.sampled_from([" ", " ", "  ", "\t", ""]))
    line = draw(st.sampled_from(["", "", " ", "N7 "])) + gap.join(part for part in parts if part)
    if comments:
        line += draw(st.sampled_from(["", "", " ", " ; note X1 E9", " (in the middle)", ";"]))
    return line


def motions(letters: str = "XYZE") -> st.SearchStrategy[str]:
    """G0 and G1 lines."""
    command = st.sampled_from(["G0", "G1", "G1", "g1", "G01"])
    feed = st.sampled_from([{}, {}, {"F": "1200"}, {"F": "3000.5"}])
    return st.tuples(command, words(letters), feed).flatmap(lambda t: spelled(t[0], {**t[1], **t[2]}))


def arcs() -> st.SearchStrategy[str]:
    """Whole circles, with and without a rise: they need no end that fits their centre."""
    offset = st.sampled_from(["3", "-2.5", "0.75"])
    return st.builds(
        "{} I{} J{}{}".format, st.sampled_from(["G2", "G3"]), offset, offset, st.sampled_from(["", " E.5"])
    )


def statements() -> st.SearchStrategy[str]:
    """Lines that set modes, wait, comment or are unknown, none of them refused."""
    return st.sampled_from(
        [
            "G90",
            "G91",
            "M82",
            "M83",
            "G21",
            "G20",
            "G92 E0",
            "G92 X5 Y5",
            "G28",
            "M204 S800",
            "M204 P500 T900",
            "M205 X8 Y9",
            "M220 S90",
            "M221 S110",
            "M220 B",
            "M220 R",
            "M200 D1.75",
            "M200 D0",
            "M201 X400 Y300",
            "G4 P200",
            "G4 S1",
            "G10",
            "G11",
            "G10 P0 S200",
            "T0",
            "T1",
            "M104 S210",
            "M109 S210",
            "M400",
            "M600",
            "M117 Hello X1",
            "; plain",
            ";TYPE:External perimeter",
            ";WIDTH:0.45",
            ";HEIGHT:0.2",
            ";LAYER_CHANGE",
            ";LAYER:3",
            "START_PRINT BED=60",
            "SET_VELOCITY_LIMIT ACCEL=3000",
            "EXCLUDE_OBJECT_START NAME=a",
            "%",
            "",
            "  ",
            "G17",
            "G18",
            "X1 Y2",
            "F900",
            "G91 G1 X1",
            "M73 P5 R2",
            "M106 S128",
            "G29",
            "@pause",
            "M486 AText here",
        ]
    )


def files(most: int = 40) -> st.SearchStrategy[bytes]:
    """Whole files, with LF or CRLF, with and without a last line end; nothing in them is refused but bare words."""
    line = st.one_of(motions(), motions(), statements(), arcs())
    body = st.lists(line, max_size=most)
    head = st.just(["G21", "G90", "M83", "G1 X0 Y0 Z0 F1000"])
    ends = st.sampled_from(["\n", "\n", "\r\n"])
    return st.builds(
        lambda first, rest, end, last: (end.join(first + rest) + (end if last else "")).encode(),
        head,
        body,
        ends,
        st.booleans(),
    )
