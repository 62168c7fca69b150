"""How a host ends a job early: in good order, by force, or because the port went away.

cancelled                  --> numbered: pull back, heaters off, M105 says so  --.
                                        | no answer                              +--> ENDED, confirmed or not
failed, reset, port back   --> bare lines, until an M105 says so or in vain   --'
M112                       --> ENDED at once
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from gcodectl.link.listening import HEATING
from gcodectl.link.protocol import LIVE, Phase, Step
from gcodectl.link.stopping import TRIES, Stopping, heaters_off, release

if TYPE_CHECKING:
    from gcodectl.errors import GcodectlError
    from gcodectl.link.host import Host

HALTED_TRIES = 2
"""Rounds of bare lines for a printer that has stopped by itself."""


def in_order(host: Host, why: GcodectlError) -> None:
    """Send nothing more of the job; release the plunger, switch the heaters off, and have the printer say so.

    What is planned is carried out: were it dropped (M410), lines behind it would catch up with absolute E in one blob.
    """
    if host.stopping and host.stopping.orderly:
        return  # it is under way; by force, it would leave the plunger pressed
    if host.phase not in LIVE:
        failed(host, why)
        return
    _leave(host, why, orderly=True)
    host.notes.append("stopping after what the printer has planned")
    oldest = host.outbox.flight.oldest
    if host.printer.emergency_parser or (oldest and oldest.command.startswith(HEATING)):
        host.urgent += b"M108\n"  # ends a wait for heat; without the emergency parser Marlin obeys it bare, as this is
    pressed = host.outbox.store.holds(b" E")  # else there is nothing to release, and a cold hotend would refuse
    host.pulled = host.settings.pull_back if pressed else 0.0
    host.own = [*release(host.pulled), *heaters_off(host.printer.heats), b"M107", b"M105"]


def at_once(host: Host, why: GcodectlError) -> None:
    """Send M112 past everything, bare and then numbered, and end."""
    _drop(host)
    host.urgent += b"M112\n" + host.outbox.emergency()
    host.failure = host.failure or why
    host.stopping = host.stopping or Stopping(orderly=False, within=0.0, now=host.now)
    host.phase = Phase.ENDED


def failed(host: Host, error: GcodectlError, *, halted: bool = False) -> None:
    """End with `error`; what is on its way is not waited for. `halted`: the printer has stopped by itself."""
    if host.phase in (Phase.GREETING, Phase.ASKING):
        host.failure = error
        host.go(Step.FAIL)
    elif host.phase in LIVE:
        _leave(host, error, orderly=False)
        assert host.stopping is not None
        host.stopping.hurry(host.now, HALTED_TRIES if halted else TRIES)
        go_on(host)
    elif host.stopping and host.stopping.orderly:
        host.notes.append(str(error))
        host.stopping.hurry(host.now)


def lost(host: Host, error: GcodectlError) -> None:
    """End because the port is gone, and wait a while for it: the printer behind it is to be made safe.

    The while begins when it goes for the first time: one that comes and goes is not waited for anew.
    """
    if host.ended or host.port_until < math.inf:
        host.end()
        return
    failed(host, error)
    if not host.ended:
        host.reopen_until = min(host.reopen_until, host.now + host.settings.reopen)
        host.port_until = host.reopen_until


def found(host: Host) -> None:
    """Go on making safe: the port is back."""
    host.port_until = math.inf
    if host.stopping:
        host.stopping.hurry(host.now)


def go_on(host: Host) -> None:
    """Send another round of bare lines where it is due; end where all were in vain."""
    stopping = host.stopping
    assert stopping is not None
    if host.port_until < math.inf:
        if host.now >= host.port_until:
            host.end()
    elif stopping.over(host.now):
        host.end()
    elif stopping.due(host.now):
        _drop(host)
        host.outbox.flight.clear()
        host.printer.forget_targets()  # only fresh ones count
        host.urgent += b"\n" + b"\n".join([b"M108", *heaters_off(host.printer.heats), b"M105", b""])


def _drop(host: Host) -> None:
    """Forget what the stop still had to send; a plunger that was not pulled back is not to be pushed on a resume."""
    if any(command in host.own for command in release(host.pulled)):
        host.pulled = 0.0
    host.own = []


def _leave(host: Host, error: GcodectlError, *, orderly: bool) -> None:
    host.failure, host.doubt = error, None
    host.own = []
    host.outbox.discard()
    host.stopping = Stopping(orderly=orderly, within=host.settings.stop, now=host.now)
    host.go(Step.FAIL)
