"""Errors a user can act on; each knows the exit status it ends the program with."""

from __future__ import annotations


class GcodectlError(Exception):
    """A sentence for the user; `exit_status` is what the command line ends with."""

    exit_status = 1


class UsageError(GcodectlError):
    """The call itself is off: an unknown machine, a missing option."""

    exit_status = 2


class InputError(GcodectlError):
    """The input cannot be read or understood: names the line number, its text and the remedy."""

    exit_status = 3

    def __init__(self, reason: str, *, line: int | None = None, text: str | bytes | None = None, source: str = ""):
        if isinstance(text, bytes):
            text = text.decode("utf-8", errors="replace").strip()
        self.reason, self.line, self.text = reason, line, text
        where = ":".join(part for part in (source, f"line {line}" if line is not None else "") if part)
        shown = f" `{text[:120]}`" if text else ""
        super().__init__(f"{where}:{shown} {reason}" if where else f"{shown} {reason}".strip())


class UnsafeError(GcodectlError):
    """Understood, but refused because carrying it out could do harm."""

    exit_status = 4


class RefusedError(InputError):
    """A line that must not be sent: it would arrive as another, or harm."""

    exit_status = 4


class DeviceError(GcodectlError):
    """The printer or the line to it failed."""

    exit_status = 5


class NoPortError(DeviceError):
    """There is no such port, or it cannot be opened."""

    exit_status = 10


class NoAnswerError(DeviceError):
    """The port is open, and nothing that speaks the protocol answers, or no longer does."""

    exit_status = 11


class FirmwareError(DeviceError):
    """The firmware said that it failed, was reset, or cannot understand what is sent."""

    exit_status = 12


class DisconnectedError(DeviceError):
    """The port went away under the job."""

    exit_status = 13


class CancelledError(DeviceError):
    """Somebody stopped the job: Ctrl-C, SIGTERM, or the printer's own cancel."""

    exit_status = 130
