"""Basis tasks: where flow must begin, end, dip, hold and stay away, from geometry, E and the planned speed alone.

    speed of a road |        ____________             ______________
                    |       /            \\           /              \\
                    |      /              \\   ____  /                \\
                    |     /                \\_/    \\/                  \\
                    |____/__________________________________________ _ \\____
      No-Flow       |Start| Steady-State |  Corner  | Steady-State |Stop|   No-Flow

A road is an unbroken run of moves with path and E > 0; retracts, wipes, hops, travels, dwells and barriers between two
roads are No-Flow. Start lasts until the first speed-up ends; a Corner is a valley of speed, DEPTH or more below the
lower of its rims, from where braking begins to where speeding up ends; Stop is the last braking of the road. A lasting
change of flow, by speed or by bead, LEVEL of it or more, is no Corner but another Steady-State. Tasks follow each other
without gaps. Source: Hoelzle et al. (2009), sections I and IV.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Floats, Ints
from gcodectl.jit import jit_inline, jit_lean
from gcodectl.records import Moves, Profile, SpeedPlan, TaskKind, Tasks

DEPTH = 0.1
LEVEL = 0.02
GAP = 1.0
"""Seconds of No-Flow beyond which it does not matter how long it is: a Stop waits so long to learn its gap."""
SLIVER = 1e-9
"""s: a phase this short, left over by rounding where a move ends, says nothing about the speed."""

STOP, START, CORNER = int(TaskKind.STOP), int(TaskKind.START), int(TaskKind.CORNER)
STEADY, NO_FLOW = int(TaskKind.STEADY), int(TaskKind.NO_FLOW)

# What the road is doing; held in carry[MODE]
OFF, STARTING, HOLDING, BRAKING, RECOVERING = 0, 1, 2, 3, 4
# Slots of the carry, all float64
MODE, ROAD, NOW, SINCE, SINCE_ROW, SINCE_LINE, SINCE_X, SINCE_Y, SINCE_FLOW = 0, 1, 2, 3, 4, 5, 6, 7, 8
DIP_T, DIP_ROW, DIP_LINE, DIP_RIM, DIP_PATH, LOW, LOW_X, LOW_Y = 9, 10, 11, 12, 13, 14, 15, 16
LAST_ROW, LAST_LINE, LAST_BEAD, LAST_X, LAST_Y, LAYER, TOOL, PENDING, GAP_BEFORE = 17, 18, 19, 20, 21, 22, 23, 24, 25
RIM_ROW, RIM_LINE, CARRY = 26, 27, 28
# Columns of the kernel's output
O_KIND, O_FIRST, O_LAST, O_LINE, O_LAST_LINE, O_ROAD, O_LAYER, O_TOOL, O_T0, O_T1, O_X, O_Y = range(12)
O_FLOW, O_AFTER, O_DIP, O_GAP, WIDTH = range(12, 17)


@jit_lean
def put_kernel(
    out: Floats, n: int, carry: Floats, kind: int, first: float, line: float, t0: float, t1: float,
    x: float, y: float, flow: float, after: float, dip: float,
) -> int:  # fmt: skip
    """Write one task that ends with the last row seen."""
    out[n, O_KIND], out[n, O_FIRST], out[n, O_LINE] = kind, first, line
    out[n, O_LAST], out[n, O_LAST_LINE] = max(first, carry[LAST_ROW]), max(line, carry[LAST_LINE])
    out[n, O_ROAD], out[n, O_LAYER], out[n, O_TOOL] = carry[ROAD], carry[LAYER], carry[TOOL]
    out[n, O_T0], out[n, O_T1], out[n, O_X], out[n, O_Y] = t0, t1, x, y
    out[n, O_FLOW], out[n, O_AFTER], out[n, O_DIP], out[n, O_GAP] = flow, after, dip, 0.0
    return n + 1


@jit_lean
def hold_kernel(out: Floats, n: int, carry: Floats, until: float, after: float, dips: bool) -> int:
    """Close the Steady-State since carry[SINCE], where it had any time; the flow goes on at `after`, or dips first."""
    if until > carry[SINCE]:
        n = put_kernel(
            out, n, carry, STEADY, carry[SINCE_ROW], carry[SINCE_LINE], carry[SINCE], until,
            carry[SINCE_X], carry[SINCE_Y], carry[SINCE_FLOW], after, 0.0,
        )  # fmt: skip
        if dips:
            out[n - 1, O_LAST] = max(carry[SINCE_ROW], carry[RIM_ROW])
            out[n - 1, O_LAST_LINE] = max(carry[SINCE_LINE], carry[RIM_LINE])
    return n


@jit_lean
def begin_kernel(carry: Floats, mode: int, t: float, row: float, line: float, x: float, y: float, flow: float) -> None:
    """What is under way now, and since when."""
    carry[MODE], carry[SINCE], carry[SINCE_ROW], carry[SINCE_LINE] = mode, t, row, line
    carry[SINCE_X], carry[SINCE_Y], carry[SINCE_FLOW] = x, y, flow


@jit_lean
def settled_kernel(out: Floats, n: int, carry: Floats, t: float, v: float, row: float, line: float) -> int:
    """Speeding up is over at speed v: close the Start or the Corner that it belonged to."""
    flow = carry[LAST_BEAD] * v
    if carry[MODE] == STARTING:
        n = put_kernel(
            out, n, carry, START, carry[SINCE_ROW], carry[SINCE_LINE], carry[SINCE], t,
            carry[SINCE_X], carry[SINCE_Y], flow, flow, 0.0,
        )  # fmt: skip
        out[n - 1, O_GAP] = carry[GAP_BEFORE]
    else:
        n = hold_kernel(out, n, carry, carry[DIP_T], carry[SINCE_FLOW], True)
        rim = min(carry[DIP_RIM], v)
        dip = max(0.0, (t - carry[DIP_T]) - carry[DIP_PATH] / rim) if rim > 0.0 else 0.0
        n = put_kernel(
            out, n, carry, CORNER, carry[DIP_ROW], carry[DIP_LINE], carry[DIP_T], t,
            carry[LOW_X], carry[LOW_Y], carry[SINCE_FLOW], flow, dip,
        )  # fmt: skip
    begin_kernel(carry, HOLDING, t, row, line, carry[LAST_X], carry[LAST_Y], flow)
    return n


@jit_lean
def end_road_kernel(out: Floats, n: int, carry: Floats, row: float, line: float) -> int:
    """The road ends now: close what is under way, and stop."""
    now = carry[NOW]
    if carry[MODE] == STARTING or carry[MODE] == RECOVERING:
        n = settled_kernel(out, n, carry, now, carry[LOW], carry[LAST_ROW], carry[LAST_LINE])
    braking = carry[MODE] == BRAKING
    begin = carry[DIP_T] if braking else now
    flow = carry[SINCE_FLOW]
    n = hold_kernel(out, n, carry, begin, flow, braking)
    first, first_line = (carry[DIP_ROW], carry[DIP_LINE]) if braking else (carry[LAST_ROW], carry[LAST_LINE])
    n = put_kernel(out, n, carry, STOP, first, first_line, begin, now, carry[LAST_X], carry[LAST_Y], flow, 0.0, 0.0)
    n -= 1  # it waits in the carry until its gap is known
    for k in range(WIDTH):
        carry[CARRY + k] = out[n, k]
    carry[PENDING] = 1.0
    carry[ROAD] += 1
    begin_kernel(carry, OFF, now, row, line, carry[LAST_X], carry[LAST_Y], 0.0)
    return n


@jit_lean
def release_kernel(out: Floats, n: int, carry: Floats, gap: float) -> int:
    """Put out the Stop that waited for its gap."""
    if carry[PENDING] > 0.0:
        for k in range(WIDTH):  # a loop: numba takes seconds to compile a slice's assignment
            out[n, k] = carry[CARRY + k]
        out[n, O_GAP] = min(gap, GAP)
        carry[PENDING] = 0.0
        n += 1
    return n


@jit_inline
def phase_kernel(
    out: Floats, n: int, carry: Floats, t: float, duration: float, v0: float, a: float, j: float, row: int, line: int
) -> int:
    """Follow the speed of a road through one phase."""
    if duration < SLIVER:
        carry[NOW] = t + duration
        return n
    v1 = v0 + duration * (a + duration * j / 2.0)
    path = duration * (v0 + duration * (a / 2.0 + duration * j / 6.0))
    tiny = 1e-9 * max(v0, v1)
    rising, falling = v1 > v0 + tiny, v1 < v0 - tiny
    if carry[MODE] == BRAKING and not falling:
        if rising and carry[LOW] < (1.0 - DEPTH) * carry[DIP_RIM]:
            carry[MODE] = RECOVERING
        else:  # a ripple, or a lasting change of speed
            carry[MODE] = HOLDING
    elif (carry[MODE] == STARTING or carry[MODE] == RECOVERING) and not rising:
        n = settled_kernel(out, n, carry, t, v0, row, line)
    flow = v0 * carry[LAST_BEAD]
    if carry[MODE] == HOLDING and not (rising or falling):
        if abs(flow - carry[SINCE_FLOW]) > LEVEL * max(flow, carry[SINCE_FLOW]):
            n = hold_kernel(out, n, carry, t, flow, False)
            begin_kernel(carry, HOLDING, t, row, line, carry[LAST_X], carry[LAST_Y], flow)
    elif falling and carry[MODE] == HOLDING:
        carry[MODE] = BRAKING
        carry[DIP_T], carry[DIP_ROW], carry[DIP_LINE], carry[DIP_PATH] = t, row, line, 0.0
        carry[DIP_RIM], carry[RIM_ROW], carry[RIM_LINE] = v0, carry[LAST_ROW], carry[LAST_LINE]
    carry[DIP_PATH] += path
    carry[LOW] = v1
    carry[NOW] = t + duration
    return n


@jit_inline
def rise_and_fall_kernel(
    out: Floats, n: int, carry: Floats, t: float, duration: float, v: float, a: float, j: float, row: int, line: int,
    x: float, y: float,
) -> int:  # fmt: skip
    """Follow a phase whose speed may turn on the way, as it does at a peak too short to cruise: each part by itself."""
    turn = -a / j if a * (a + duration * j) < 0.0 else duration
    begin = 0.0
    for end in (turn, duration):
        low_before = carry[LOW]
        if end > begin:
            n = phase_kernel(
                out, n, carry, t + begin, end - begin, v + begin * (a + begin * j / 2.0), a + begin * j, j, row, line
            )
        if carry[MODE] == BRAKING and carry[LOW] < low_before:
            carry[LOW_X], carry[LOW_Y] = x, y
        begin = end
    return n


@jit_lean
def tasks_kernel(
    row: Ints, line: Ints, layer: NDArray[np.int32], tool: NDArray[np.int16], deposits: Bools, breaks: Bools,
    bead: Floats, p0: Floats, p1: Floats, phase_row: Ints, t: Floats, duration: Floats, v: Floats, a: Floats, j: Floats,
    carry: Floats, out: Floats,
) -> int:  # fmt: skip
    """Walk moves and their phases; fills `out` with the tasks that ended and brings `carry` up to date.

    Returns how many tasks there are.
    """
    n = 0
    p = 0
    for i in range(len(row)):
        if deposits[i] and carry[MODE] == OFF:
            n = release_kernel(out, n, carry, carry[NOW] - carry[SINCE])
            carry[LAYER], carry[TOOL] = layer[i], tool[i]
            carry[GAP_BEFORE] = min(GAP, carry[NOW] - carry[SINCE]) if carry[ROAD] > 0 else GAP
            n = put_kernel(
                out, n, carry, NO_FLOW, carry[SINCE_ROW], carry[SINCE_LINE], carry[SINCE], carry[NOW],
                carry[SINCE_X], carry[SINCE_Y], 0.0, 0.0, 0.0,
            )  # fmt: skip
            begin_kernel(carry, STARTING, carry[NOW], row[i], line[i], p0[i, 0], p0[i, 1], 0.0)
            carry[DIP_PATH], carry[LOW] = 0.0, 0.0
        elif breaks[i] and carry[MODE] != OFF:
            n = end_road_kernel(out, n, carry, row[i], line[i])
        if deposits[i]:
            carry[LAST_BEAD] = bead[i]
        while p < len(phase_row) and phase_row[p] == row[i]:
            if deposits[i]:
                n = rise_and_fall_kernel(
                    out, n, carry, t[p], duration[p], v[p], a[p], j[p], row[i], line[i], p1[i, 0], p1[i, 1]
                )
                carry[LAST_ROW], carry[LAST_LINE] = row[i], line[i]
            else:
                carry[NOW] = t[p] + duration[p]
                if carry[NOW] - carry[SINCE] >= GAP:
                    n = release_kernel(out, n, carry, GAP)
            p += 1
        if deposits[i] or breaks[i]:
            carry[LAST_ROW], carry[LAST_LINE] = row[i], line[i]
            carry[LAST_X], carry[LAST_Y] = p1[i, 0], p1[i, 1]
    return n


def segment(
    chunks: Iterable[tuple[Moves, SpeedPlan, Profile]],
) -> Iterator[tuple[Moves, SpeedPlan, Profile, Tasks, float]]:
    """Find the basis tasks in timed moves.

    Yields each chunk with the tasks that ended in it and `known`, s: no task still to come begins before it. At the end
    of the input comes one more, empty chunk with what was under way, and `known` = inf.
    """
    carry = np.zeros(CARRY + WIDTH)
    carry[LAST_ROW] = carry[LAST_LINE] = -1.0
    carry[SINCE_LINE] = 1.0
    for moves, speeds, profile in chunks:
        deposits = moves.deposits & (speeds.distance > 0)
        breaks = ~deposits & ((speeds.distance > 0) | speeds.rests)
        bead = np.where(deposits, moves.e * moves.area / np.where(deposits, moves.length, 1.0), 0.0)
        out = np.empty((4 * len(profile) + 4 * len(moves) + 4, WIDTH))
        made = tasks_kernel(
            moves.row, moves.line, moves.layer, moves.tool, deposits, breaks, bead, moves.p0, moves.p1,
            profile.row, profile.t, profile.duration, profile.v, profile.a, profile.j, carry, out,
        )  # fmt: skip
        under_way = carry[DIP_T] if carry[MODE] in (BRAKING, RECOVERING) else carry[NOW]
        waits = carry[MODE] == STARTING or carry[PENDING] > 0
        known = carry[SINCE] if waits else under_way
        yield moves, speeds, profile, _tasks(out[:made]), float(known)
    out = np.empty((8, WIDTH))
    made = 0
    if carry[MODE] != OFF:
        made = end_road_kernel(out, 0, carry, carry[LAST_ROW], carry[LAST_LINE])
    made = release_kernel(out, made, carry, GAP)
    made = put_kernel(
        out, made, carry, NO_FLOW, carry[SINCE_ROW], carry[SINCE_LINE], carry[SINCE], carry[NOW],
        carry[SINCE_X], carry[SINCE_Y], 0.0, 0.0, 0.0,
    )  # fmt: skip
    yield Moves.empty(), SpeedPlan.empty(), Profile.empty(), _tasks(out[:made]), float("inf")


def _tasks(rows: Floats) -> Tasks:
    integer = rows.astype(np.int64)
    return Tasks(
        kind=integer[:, O_KIND].astype(np.int8),
        first=integer[:, O_FIRST],
        last=integer[:, O_LAST],
        first_line=integer[:, O_LINE],
        last_line=integer[:, O_LAST_LINE],
        road=integer[:, O_ROAD],
        layer=integer[:, O_LAYER].astype(np.int32),
        tool=integer[:, O_TOOL].astype(np.int16),
        t0=rows[:, O_T0].copy(),
        t1=rows[:, O_T1].copy(),
        x=rows[:, O_X].copy(),
        y=rows[:, O_Y].copy(),
        flow=rows[:, O_FLOW].copy(),
        flow_after=rows[:, O_AFTER].copy(),
        dip=rows[:, O_DIP].copy(),
        gap=rows[:, O_GAP].copy(),
    )
