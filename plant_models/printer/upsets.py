"""How each fault strikes the virtual printer: on a line coming in, a command beginning, an ok going out."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gcodectl.link.receiver import Resend
from plant_models.printer.faults import Fault, Stage

if TYPE_CHECKING:
    from plant_models.printer.virtual import VirtualPrinter

_NUMBERED = re.compile(rb" *N(\d{1,18})")


def incoming(printer: VirtualPrinter, data: bytes) -> bytes:
    """Return what arrives of the bytes; a line that is not whole yet waits for its end."""
    whole, newline, rest = (printer.partial + data).rpartition(b"\n")
    printer.partial = rest[-65_536:]
    if not newline:
        return b""
    return b"".join(_line(printer, line + b"\n") for line in whole.split(b"\n"))


def _line(printer: VirtualPrinter, line: bytes) -> bytes:
    match = _NUMBERED.match(line)
    number = int(match[1]) if match else None
    for fault in printer.strikes.at(Stage.LINE, number):
        if fault.name == "lost-line":
            return b""
        if fault.name == "garble-in":
            line = printer.strikes.flipped(line)
        elif number is not None:
            line = _wrong(printer, line, number, fault)
    return line


def _wrong(printer: VirtualPrinter, line: bytes, number: int, fault: Fault) -> bytes:
    """Return a numbered line that the firmware will not take, and set how it is to ask for it again."""
    text, star, told = line.rpartition(b"*")
    if not star:
        return line
    if fault.name == "missing-checksum":
        return text + b"\n"
    usual = printer.dialect.ok_after_resend
    if fault.name == "checksum-ok":
        printer.receiver.resends[number] = Resend(ok=True)
    elif fault.name == "checksum-no-ok":
        printer.receiver.resends[number] = Resend(ok=False)
    elif fault.name == "duplicate-resend":
        printer.receiver.resends[number] = Resend(ok=usual, times=2)
    digits = told.strip()
    return b"%s*%d\n" % (text, (int(digits) + 1) % 256 if digits.isdigit() else 0)


def strike(printer: VirtualPrinter, fault: Fault) -> bool:
    """Let a fault strike as a command is begun; return whether the command is carried out all the same."""
    name, value = fault.name, fault.value
    if name in ("busy", "silence"):
        printer.turn.delay(printer.now + value, silent=name == "silence")
    elif name in ("pause", "resume", "cancel"):
        printer.say(b"//action:%s\n" % name.encode())
        if name == "pause":
            printer.outlet.announce(b"//action:resume\n", printer.now + value)
    elif name == "noise":
        printer.say(_noise(printer, round(value)))
    elif name == "bogus-resend":
        _ask(printer, round(value))
    elif name == "future-resend":
        _ask(printer, printer.receiver.last + round(value))
    elif name == "close":
        _close(printer, value)
    elif name == "reset":
        _reset(printer)
        return False
    elif name == "thermal":
        printer.say(b"Error:Thermal Runaway, system stopped! Heater_ID: 0\n")
        printer.kill()
        return False
    elif name == "kill":
        printer.kill()
        return False
    elif name == "dead":
        printer.die()
        return False
    return True


def _reset(printer: VirtualPrinter) -> None:
    """Boot again: queue, modes and position are lost, heaters are off, everything said is cut off."""
    printer.outlet.hold_nothing()
    printer.receiver.reset()
    printer.motion.quickstop(printer.now)
    for text in (b"G90", b"M82", b"M220 S100", b"M221 S100", b"G92 X0 Y0 Z0 E0"):
        printer.motion.take(text, printer.now)
    printer.boot()


def _close(printer: VirtualPrinter, seconds: float) -> None:
    """Lose the port for a while; what is under way on it is lost."""
    printer.outlet.lose()
    printer.partial = b""
    printer.open_at = printer.now + seconds


def _ask(printer: VirtualPrinter, number: int) -> None:
    """Ask for a line that was not missed."""
    text = b"Error:checksum mismatch, Last Line: %d\nResend: %d\n" % (number - 1, number)
    printer.say(text + (b"ok\n" if printer.dialect.ok_after_resend else b""))


def _noise(printer: VirtualPrinter, count: int) -> bytes:
    """Return a line of bytes that mean nothing to anyone: the first is never ASCII, so that it cannot begin an ok."""
    random = printer.strikes.random
    first = bytes([random.randrange(128, 256)])
    return first + random.randbytes(max(count - 1, 0)).replace(b"\n", b"\x00").replace(b"\r", b"\x00") + b"\n"


def outgoing(printer: VirtualPrinter, ok: bytes, number: int | None) -> None:
    """Send an ok, or what the faults leave of it."""
    late, parts = 0.0, [(0.0, ok)]
    for fault in printer.strikes.at(Stage.OK, number):
        if fault.name == "lost-ok":
            return
        if fault.name == "garble-out":
            parts = [(after, printer.strikes.flipped(part)) for after, part in parts]
        elif fault.name == "join-ok":
            parts = [(after, part.removesuffix(b"\n")) for after, part in parts]
        elif fault.name == "split-ok":
            parts = [(0.0, ok[:1]), (fault.value, ok[1:])]
        elif fault.name == "slow-ok":
            late += fault.value
    for after, part in parts:
        printer.say(part, late + after)
