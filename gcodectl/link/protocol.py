"""The states of the host's side of the link, and the table of what leads from one to the next.

                    greeted          asked             drained             finished
        GREETING ------------> ASKING ------> PRINTING ------> FINISHING ------> ENDED
            ^----- reset --------'               ^  |                              ^
                                           resume|  |pause                         | safe
                                                PAUSED                             |
              PRINTING, PAUSED, FINISHING --- fail ---> STOPPING ------------------'

A reset before the job begins starts the link anew; one in mid-job ends the job: what the printer had planned is gone,
and where it stands is unknown, so nothing is ever replayed. The printer's side of the protocol is in `receiver`.
"""

from __future__ import annotations

import enum


class Phase(enum.Enum):
    """Where a host is with its job."""

    GREETING = enum.auto()
    """The port is open; M110 is sent until the printer answers."""
    ASKING = enum.auto()
    """What can it do: M115, M113, M105."""
    PRINTING = enum.auto()
    PAUSED = enum.auto()
    FINISHING = enum.auto()
    """The last line is acknowledged; M400 waits for the motion."""
    STOPPING = enum.auto()
    """Heaters off, pressure released; nothing of the job is sent any more."""
    ENDED = enum.auto()


class Step(enum.Enum):
    """What leads from one phase to another."""

    GREETED = enum.auto()
    ASKED = enum.auto()
    PAUSE = enum.auto()
    RESUME = enum.auto()
    DRAINED = enum.auto()
    FINISHED = enum.auto()
    RESET = enum.auto()
    FAIL = enum.auto()
    SAFE = enum.auto()


TRANSITIONS: dict[Phase, dict[Step, Phase]] = {
    Phase.GREETING: {Step.GREETED: Phase.ASKING, Step.RESET: Phase.GREETING, Step.FAIL: Phase.ENDED},
    Phase.ASKING: {Step.ASKED: Phase.PRINTING, Step.RESET: Phase.GREETING, Step.FAIL: Phase.ENDED},
    Phase.PRINTING: {Step.PAUSE: Phase.PAUSED, Step.DRAINED: Phase.FINISHING, Step.FAIL: Phase.STOPPING},
    Phase.PAUSED: {Step.RESUME: Phase.PRINTING, Step.FAIL: Phase.STOPPING},
    Phase.FINISHING: {Step.FINISHED: Phase.ENDED, Step.FAIL: Phase.STOPPING},
    Phase.STOPPING: {Step.SAFE: Phase.ENDED},
    Phase.ENDED: {},
}
"""What is not in the table does not happen: `follow` leaves the phase as it is and says so."""

LIVE = frozenset({Phase.PRINTING, Phase.PAUSED, Phase.FINISHING})
"""The job has begun: a reset ends it."""


def follow(phase: Phase, step: Step) -> Phase | None:
    """Return the phase that `step` leads to from `phase`; None where it leads nowhere."""
    return TRANSITIONS[phase].get(step)
