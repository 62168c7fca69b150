"""The journal of a job at the command line: kept while it runs, and where a job goes on that broke off."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from gcodectl.errors import CancelledError, FirmwareError, InputError, UsageError

if TYPE_CHECKING:
    from collections.abc import Callable

    from gcodectl.cli.jobs import Job
    from gcodectl.link.host import Host
    from gcodectl.link.journal import Entry
    from gcodectl.link.resume import Resumed


def find(job: Job) -> Entry:
    """Return where the job broke off; InputError where it did not, or is another by now."""
    from gcodectl.cli.common import STDIN
    from gcodectl.link.journal import digest, journal_path, read

    if job.source == STDIN:
        raise UsageError("--resume takes a FILE: what came down a pipe is gone")
    path = Path(job.source)
    entry = read(journal_path(path, dict(os.environ)))
    if entry.digest != digest(path, job.how()):
        raise InputError("the file, or how it is filtered, has changed since it broke off", source=job.source)
    return entry


def confirm(job: Job, entry: Entry, *, yes: bool) -> None:
    """Say what going on means, and ask whether to; CancelledError where not."""
    from gcodectl.link.journal import EVERY

    killed = f" It was killed: what it sent in the last {EVERY:g} s or so would come twice." if not entry.ended else ""
    typer.echo(
        f"gcodectl: {job.source} broke off after line {entry.line}, the last that the printer acknowledged. "
        f"Acknowledged is not deposited: up to some 20 moves before it may be missing.{killed} It goes on from there "
        "without homing, so the printer must not have been reset, switched off or moved by hand; heaters are brought "
        "up first.",
        err=True,
    )
    if not yes and not typer.confirm("Go on?", err=True):
        raise CancelledError("not resumed")


class Keeper:
    """Keeps the journal of a file's job; a pipe has none. Call `turn` often, and `close` at the end."""

    def __init__(self, job: Job, host: Host, entry: Entry | None, resumed: Resumed | None) -> None:
        from gcodectl.cli.common import STDIN
        from gcodectl.link.journal import digest, journal_path

        path = None if job.source == STDIN else Path(job.source)
        self._path = journal_path(path, dict(os.environ)) if path else None
        self._digest = digest(path, job.how()) if path else ""
        self._job, self._host, self._resumed = job, host, resumed
        self._first = entry.line if entry else 0
        self._written, self._next, self._began = self._first, 0.0, False

    @property
    def reached(self) -> int:
        """The last line that was acknowledged, now or before the job was resumed."""
        return max(self._host.reached, self._first)

    @property
    def can_resume(self) -> bool:
        """Whether there is a journal to go on by."""
        return self._path is not None and self._began and self.reached > 0

    def turn(self) -> None:
        """Write how far the job is, now and then."""
        from gcodectl.link.journal import EVERY, remove
        from gcodectl.link.protocol import LIVE

        if not self._began and (self._host.phase in LIVE or self._host.reached):
            self._began = True
            if self._resumed is None:
                self._keep(remove)  # of a print before this one
        now = time.monotonic()
        if self._began and self.reached > self._written and now >= self._next:
            self._next, self._written = now + EVERY, self.reached
            self._write(ended=False)

    def close(self) -> None:
        """Write the last entry, or remove the journal of a job that is done; one that never began leaves it."""
        from gcodectl.link.journal import remove

        if self._host.failure is None:
            self._keep(remove)
        elif self.can_resume:
            self._write(ended=True)

    def _write(self, *, ended: bool) -> None:
        from gcodectl.link.journal import Entry, write

        pulled = self._host.pulled
        pulled += self._resumed.owed if self._resumed else 0.0
        source = str(Path(self._job.source).resolve())
        entry = Entry(source, self._digest, self.reached, self._job.lines, pulled, ended)
        self._keep(lambda path: write(path, entry))

    def _keep(self, act: Callable[[Path], None]) -> None:
        """Do something to the journal; what fails there is no reason to end a print."""
        if self._path is None:
            return
        try:
            act(self._path)
        except OSError as error:
            self._host.notes.append(f"the journal cannot be kept ({error}): --resume will not know of this job")
            self._path = None


def conclude(host: Host, keeper: Keeper, port: str) -> None:
    """Raise what ended the job early, with what is to be known about it."""
    failure = host.failure
    if failure is None:
        return
    words = [str(failure)]
    if host.outbox.store.next == host.outbox.store.first:  # nothing was ever answered
        words.append(f"the port was {port}")
    if not host.safe:
        words.append("the printer did not confirm that its heaters are off: see to it, or switch it off")
    if keeper.can_resume:
        halted = isinstance(failure, FirmwareError) or not host.safe
        knows = "if the printer still knows where it is, " if halted else ""
        words.append(f"line {keeper.reached} was the last acknowledged; {knows}`--resume` goes on after it")
    failure.args = ("; ".join(words),)
    raise failure
