"""The sequencer: which basis signal drives the plunger at each moment, and what it says.

Two ways to put learned signals in sequence, one kernel each; both add to the feed-forward q_ref / K and both scale a
signal with the flow of its road.

**concatenate** is the paper's. One signal at a time, chosen by priority (Fig. 7) among those whose time has come and
that may follow the one before (Fig. 8); the one that loses is cut short, and where two do not meet, the step between
them is faded out over BLEND seconds.

              Stop wins over      Start wins over   Corner wins over   Steady-State, No-Flow
    u |                 ____                              may follow:  Stop   Start  Corner  Steady  No-Flow
      |   __           |    \\___                         Stop                  x                       x
      |  /  \\_________/ (cut)   \\                        Start          x             x       x
      |_/               Corner   \\     __               Corner         x             x       x
      | Start  Steady-State       \\   / Start of the     Steady-State   x             x       x
      |                  Stop      \\_/  next road        No-Flow               x                       x

**superpose** takes a signal as what it adds to the feed-forward and lets those of neighbouring tasks add up. On a
linear extruder that is exact: the flow of a sum is the sum of the flows. A Stop and the Start that follows after a
travel too short for both then cancel where they overlap, instead of one being cut and its volume missing ever after.

Source: Hoelzle et al. (2009), section IV, Figs. 7 and 8; superposition in place of IV-B's plain sequence is ours.
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Bools, Floats, Ints
from gcodectl.jit import jit
from gcodectl.records import TaskKind

BLEND = 0.05

_MAY_FOLLOW = {
    TaskKind.STOP: (TaskKind.START, TaskKind.NO_FLOW),
    TaskKind.START: (TaskKind.STOP, TaskKind.CORNER, TaskKind.STEADY),
    TaskKind.CORNER: (TaskKind.STOP, TaskKind.CORNER, TaskKind.STEADY),
    TaskKind.STEADY: (TaskKind.STOP, TaskKind.CORNER, TaskKind.STEADY),
    TaskKind.NO_FLOW: (TaskKind.START, TaskKind.NO_FLOW),
}
"""The paper's Fig. 8 for one material; a switch of material is a Stop, the dwell of the head, and the other's Start."""

TRANSITIONS = np.array([[after in _MAY_FOLLOW[before] for after in TaskKind] for before in TaskKind])
"""`TRANSITIONS[before, after]`: whether task `after` may follow `before`."""

STOP, START, CORNER = int(TaskKind.STOP), int(TaskKind.START), int(TaskKind.CORNER)
STEADY, NO_FLOW = int(TaskKind.STEADY), int(TaskKind.NO_FLOW)


@jit
def sample_kernel(signal: Floats, count: int, position: float) -> float:
    """The signal at `position` samples from its first, linear between samples; each end is held for one sample."""
    if count == 0 or position <= -1.0 or position >= count:
        return 0.0
    low = min(max(int(np.floor(position)), 0), count - 1)
    share = min(max(position - low, 0.0), 1.0)
    left = signal[low]
    right = signal[low + 1] if low + 1 < count else left
    return float(left + share * (right - left))


@jit
def superpose_kernel(
    kind: Ints, tool: Ints, when: Floats, shift: Floats, scale: Floats, start: Floats,
    first: int, dt: float, values: Floats, count: Ints, lead: Floats, learned_dip: Floats, steady: Floats, out: Floats,
) -> None:  # fmt: skip
    """Add what each task's signal adds to the feed-forward to `out`, whose sample n spans (first + n) dt onwards.

    `when` is the task's moment: a road's begin (Start), its end (Stop), the middle of the dip (Corner); its signal
    comes `shift` later than it was learned, `scale` times as large as at a flow of 1 mm^3/s. None begins before its
    `start`.
    """
    for i in range(len(kind)):
        c, m = tool[i], kind[i]
        begin = when[i] + shift[i] - lead[c, m]
        low = max(int(np.ceil(max(begin, start[i]) / dt - 0.5)), first)
        high = int(np.floor((begin + count[c, m] * dt) / dt - 0.5))
        for n in range(low, min(high, first + len(out) - 1) + 1):
            middle = (n + 0.5) * dt
            base = steady[c]
            if m == START:
                base *= min(1.0, max(0.0, (middle - when[i]) / dt + 0.5))
            elif m == STOP:
                base *= min(1.0, max(0.0, (when[i] - middle) / dt + 0.5))
            elif abs(middle - when[i]) < 0.5 * learned_dip[c]:
                base = 0.0
            position = (middle - begin) / dt - 0.5
            out[n - first] += scale[i] * (sample_kernel(values[c, m], count[c, m], position) - base)


@jit
def choose_kernel(
    t: float, active: int, active_task: int, kind: Ints, begin: Floats, end: Floats, begun: Ints,
    low: int, transitions: Bools,
) -> int:  # fmt: skip
    """Return the task whose signal is due at t by priority and transition, or -1; `begun[i]` is 1 once i has run.

    A Start that has not begun stays due until its road ends: flow must not be missed for having come late.
    """
    best = -1
    for i in range(low, len(kind)):
        if begin[i] > t + 60.0:
            break
        if begin[i] > t or t >= end[i]:
            continue
        if best >= 0 and kind[i] >= kind[best]:
            continue
        if i == active_task or (transitions[active, kind[i]] and not begun[i]):
            best = i
    return best


@jit
def concatenate_kernel(
    kind: Ints, tool: Ints, when: Floats, flow: Floats, dip: Floats, start: Floats, road_end: Floats,
    first: int, upto: int, dt: float, reference: Floats,
    values: Floats, count: Ints, lead: Floats, learned_dip: Floats, steady: Floats, transitions: Bools,
    begun: Ints, state: Floats, spans: Floats, out: Floats, chosen: Ints,
) -> None:  # fmt: skip
    """Write u for samples `first` to `upto` by priority; `chosen` gets each sample's task kind.

    `spans` (2, tasks) is room to note from when to when each task's signal is due.
    `state` is (active kind, its row in these arrays or -1, u before, step still to fade, seconds it has faded, the
    reference before). Where u follows the reference before and after, no step is there to be faded.
    """
    begin, end = spans[0], spans[1]
    for i in range(len(kind)):
        begin[i] = max(when[i] - lead[tool[i], kind[i]], start[i])
        end[i] = when[i] - lead[tool[i], kind[i]] + count[tool[i], kind[i]] * dt
        if kind[i] == START and count[tool[i], kind[i]] == 0:
            begin[i] -= 0.5 * dt  # nothing but the reference: from the sample on that the road begins in
        if kind[i] == START and not begun[i]:
            end[i] = max(end[i], road_end[i])
    low = 0
    for n in range(upto - first):
        t = (first + n + 0.5) * dt
        while low < len(kind) and end[low] < t - 60.0:
            low += 1
        active, task = int(state[0]), int(state[1])
        best = choose_kernel(t, active, task, kind, begin, end, begun, low, transitions)
        if best >= 0:
            c, m = tool[best], kind[best]
            position = (t - (when[best] - lead[c, m])) / dt - 0.5
            late = position >= count[c, m] - 1
            value = flow[best] * sample_kernel(values[c, m], count[c, m], position)
            if m == CORNER:
                share = min(1.0, dip[best] / learned_dip[c]) if learned_dip[c] > 0.0 else 0.0
                base = flow[best] * steady[c]  # not the reference: the signal has the dip of the gantry in it
                value = base + share * (value - base)
            elif m == START and late:
                value = reference[n]
            now = STEADY if m == START and late and best == task else m
            begun[best] = 1
            if m == START:  # from now on it ends with its samples, or no Corner of the road would ever have its turn
                end[best] = when[best] - lead[c, m] + count[c, m] * dt
        else:  # a road that ends without a Stop of its own has stopped all the same
            flows = active != NO_FLOW and active != STOP
            now = (STEADY if reference[n] > 0.0 else STOP) if flows else NO_FLOW
            value = reference[n] if now == STEADY else 0.0
        if best != task or now != active:
            follows = value == reference[n] and state[2] == state[5]
            state[3], state[4] = 0.0 if follows else state[2] - value, 0.0
        fade = max(0.0, 1.0 - state[4] / BLEND)
        state[4] += dt
        out[n] = value + state[3] * fade
        state[0], state[1], state[2], state[5] = now, best, out[n], reference[n]
        chosen[n] = now
