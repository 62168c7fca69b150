"""What a host does about each thing that a printer says: a function a kind of reply, and the table of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from gcodectl.errors import CancelledError, FirmwareError, NoAnswerError
from gcodectl.link.known import is_cold
from gcodectl.link.outbox import SETTLE, Again, Outbox
from gcodectl.link.protocol import LIVE, Phase, Step
from gcodectl.link.replies import Heat, Kind, Reply

if TYPE_CHECKING:
    from gcodectl.link.host import Host

DOUBT = 1.0
"""s after an unknown error in which a resend request says that it was but a damaged line error."""
NOTHING_ODD = (0, 0)
ODD = 3
"""Odd resend requests in a row that end the job."""
LOST_PLACE = "the printer was reset, perhaps as its port was opened: it no longer knows where it is; print anew"
IDLE = 0.5
"""s without anything said or sent after which a `wait` says that what was sent is lost."""
HEATING = (b"M109", b"M190", b"M191", b"M116", b"M303")
"""Commands whose reports of temperatures are signs of life."""


def sign(host: Host, _: Reply) -> None:
    """Take a sign of life."""
    host.patience.life = host.now
    host.outbox.alive(host.now)
    if host.stopping:
        host.stopping.alive(host.now)


def ok(host: Host, reply: Reply) -> None:
    """Take an answer."""
    if reply.heats:
        heated(host, reply.heats, asked=True)
    if host.phase is Phase.GREETING:
        # greeted more than once, it answers more than once: the others must not be taken for answers to what follows
        host.heard, host.greet_at = True, host.now + SETTLE
        return
    sign(host, reply)
    outbox = host.outbox
    if outbox.answered(reply, host.now):
        host.odd = NOTHING_ODD
        host.reached = outbox.store.source(outbox.acked) or host.reached


def resend(host: Host, reply: Reply) -> None:
    """Go back as the printer asks, where that can be."""
    assert reply.number is not None
    sign(host, reply)
    host.doubt = None
    if host.phase is Phase.GREETING:
        return
    if host.bare:
        return
    insists = host.odd[1] > 0 and host.odd[0] == reply.number
    outcome = host.outbox.again(reply.number, host.now, insists=insists)
    if outcome is Again.TOO_OFTEN:
        times = host.settings.resends
        host.fail(FirmwareError(f"the printer asked more than {times} times for one line: is the cable sound?"))
    elif outcome is Again.ODD:
        odd(host, reply.number)


def odd(host: Host, number: int) -> None:
    """Follow no request for a line that was answered, or that there is not: ask how far the printer is instead."""
    if host.phase is Phase.ASKING:
        restart(host)
        return
    host.odd = (number, host.odd[1] + 1)
    host.notes.append(f"the printer asks for line {number} and was at {host.outbox.acked}: not followed")
    if host.odd[1] >= ODD:
        host.fail(FirmwareError(f"the printer asks for line {number}, and was at {host.outbox.acked}: was it reset?"))
    else:
        host.urgent += host.outbox.probe(host.now)


def restart(host: Host) -> None:
    """Begin the link anew: the printer was reset while it was being asked what it can."""
    if host.settings.resumed:
        host.fail(FirmwareError(LOST_PLACE))
    elif host.go(Step.RESET):
        host.outbox = Outbox(host.settings)
        host.own, host.heard, host.greet_at = [], False, host.now


def start(host: Host, _: Reply) -> None:
    """Note that the printer was reset: before the job begins that is nothing, in mid-job it is the end."""
    if host.settings.resumed and host.phase in (Phase.GREETING, Phase.ASKING):
        host.fail(FirmwareError(LOST_PLACE))
    elif host.phase is Phase.GREETING:
        host.heard, host.greet_at = False, host.now
    elif host.phase is Phase.ASKING:
        restart(host)
    else:
        host.fail(FirmwareError("the printer was reset: its position and what it had planned are lost"))


def fatal(host: Host, reply: Reply) -> None:
    """End: the printer has."""
    host.fail(FirmwareError(f"the printer says: {reply.text}"), halted=True)


def error(host: Host, reply: Reply) -> None:
    """Doubt: it is a damaged line error, which a resend request follows, or the end."""
    if host.phase in LIVE and host.doubt is None:
        host.doubt = (host.now + DOUBT, reply.text)


def wait(host: Host, _: Reply) -> None:
    """Ask at once: a printer that waits for a command has none of those that are on their way."""
    quiet = host.now - max(host.patience.life, host.outbox.sent_at)
    if host.phase in LIVE and host.outbox.flight and not host.outbox.holding and quiet >= IDLE:
        if host.outbox.probes >= host.settings.probes:  # it lives, and hears nothing
            host.fail(NoAnswerError("the printer says that it waits, and answers nothing that it is sent"))
            return
        host.patience.life = host.now
        host.urgent += host.outbox.probe(host.now)


def temperature(host: Host, reply: Reply) -> None:
    """Take a report of temperatures."""
    heated(host, reply.heats or {}, asked=not host.outbox.flight.tells)
    oldest = host.outbox.flight.oldest
    if oldest is not None and oldest.command.startswith(HEATING):
        sign(host, reply)


def heated(host: Host, heats: dict[str, Heat], *, asked: bool) -> None:
    """Note what the heaters are at; only what was asked for (or cannot be told from it) says that a stop was heard."""
    host.printer.heats.update(heats)
    if host.bare and asked and is_cold(heats):
        host.end(confirmed=True)


def action(host: Host, reply: Reply) -> None:
    """Do what the printer asks of its host."""
    word = reply.text.split(" ")[0]
    if word in ("pause", "paused"):
        if host.go(Step.PAUSE):
            host.notes.append("the printer asks for a pause")
    elif word in ("resume", "resumed"):
        if host.go(Step.RESUME):
            host.notes.append("the printer goes on")
    elif word == "cancel":
        host.cancel(CancelledError("the printer's own cancel"), host.now)
    elif word in ("poweroff", "disconnect", "shutdown"):
        host.fail(FirmwareError(f"the printer asks for {word}"))


def keeps_alive(host: Host, reply: Reply) -> None:
    """Note how often the printer says that it is busy."""
    host.patience.keepalive = float(reply.number or 0)


def capability(host: Host, reply: Reply) -> None:
    """Note what the printer can."""
    host.printer.can(reply)


HANDLERS: dict[Kind, Callable[[Host, Reply], None]] = {
    Kind.OK: ok,
    Kind.RESEND: resend,
    Kind.LINE_ERROR: sign,
    Kind.FATAL: fatal,
    Kind.ERROR: error,
    Kind.BUSY: sign,
    Kind.WAIT: wait,
    Kind.START: start,
    Kind.TEMPERATURE: temperature,
    Kind.ACTION: action,
    Kind.CAPABILITY: capability,
    Kind.KEEPALIVE: keeps_alive,
}
