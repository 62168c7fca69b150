"""`gcodectl stream`: a file, filtered on the way if asked, down a serial link to a printer."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcodectl.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gcodectl.cli.jobs import Job
    from gcodectl.link.host import Host
    from gcodectl.link.job import Line
    from gcodectl.link.journal import Entry
    from gcodectl.link.settings import Settings


def command(
    file: Annotated[str, typer.Argument(metavar="FILE|-", help="G-code to send; `-` is standard input.")],
    port: Annotated[
        str, typer.Option(metavar="URL", help="/dev/tty..., COM3, socket://host:port, rfc2217://..., hwgrep://...")
    ] = "auto",
    baud: Annotated[int, typer.Option(help="Bits a second.")] = 115_200,
    window: Annotated[
        str, typer.Option(metavar="1|N|auto", help="Commands on their way at once; auto: as ADVANCED_OK tells.")
    ] = "1",
    rx_bytes: Annotated[int, typer.Option(help="Bytes on their way at once, where the window is more than 1.")] = 127,
    filtered: Annotated[bool, typer.Option("--filter", help="Lay learned flow signals over it on the way.")] = False,
    machine: Annotated[
        str, typer.Option("--machine", "-m", help="Machine profile: a name, or a .toml file.")
    ] = "syringe",
    material: Annotated[
        list[str] | None, typer.Option("--material", help="With --filter: the material, once for each tool.")
    ] = None,
    quality: Annotated[str, typer.Option(help="With --filter: TIME, BALANCED, BEAD, or 0..1.")] = "BALANCED",
    resume: Annotated[bool, typer.Option("--resume", help="Go on with this file where it broke off.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="With --resume: do not ask.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Check everything, and open no port.")] = False,
    log: Annotated[Path | None, typer.Option(metavar="FILE", help="Write every line each way, with times.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print events as JSON, a line each.")] = False,
) -> None:
    """Send FILE to a printer, every line exactly once and in order, or end with the printer made safe.

    Exit status 4: a line must not be sent. 10: no port. 11: no answer. 12: the firmware failed. 13: disconnected.
    130: cancelled. Ctrl-C stops in good order, a second one at once (M112).
    """
    from gcodectl.cli.common import announce_compiling, filter_options
    from gcodectl.cli.jobs import prepare

    settings = _settings(window, rx_bytes)
    if material and not filtered:
        raise UsageError("--material goes with --filter")
    options = (
        filter_options(file, machine, material or ["neutral"], "model", quality, "replace", pass_unknown=False)
        if filtered
        else None
    )
    announce_compiling()
    job = prepare(file, machine, options)
    entry = _broken_off(job, yes=yes) if resume else None
    if dry_run:
        _show_plan(job, as_json=as_json)
        return
    _stream(job, settings, (port, baud), log, entry, as_json=as_json)


def _settings(window: str, rx_bytes: int) -> Settings:
    from gcodectl.link.settings import AUTO, Settings

    if window != "auto" and not (window.isdigit() and int(window) > 0):
        raise UsageError(f"--window {window}: there are 1, 2, 3 ... and auto")
    return Settings(window=AUTO if window == "auto" else int(window), rx_bytes=rx_bytes)


def _stream(
    job: Job, settings: Settings, port: tuple[str, int], log: Path | None, entry: Entry | None, *, as_json: bool
) -> None:
    import dataclasses
    import signal
    import time
    from contextlib import ExitStack

    from gcodectl.cli.show_stream import Shown
    from gcodectl.link.host import Host
    from gcodectl.link.sender import Log, Sender
    from gcodectl.link.transport import open_port

    first = entry.line if entry else 0
    settings = dataclasses.replace(settings, pull_back=job.pull_back)
    with ExitStack() as stack:
        writer = Log(stack.enter_context(log.open("wb"))) if log else None
        host = Host(_from(job.open(), entry), settings, time.monotonic())
        shown = Shown(job, host, as_json=as_json, first=first)
        stack.callback(shown.close)
        keeper = _Keeper(job, host, first)

        def turn() -> None:
            shown.turn()
            keeper.turn()

        sender = Sender(host, lambda: open_port(*port), log=writer, on_turn=turn)
        for one in (signal.SIGINT, signal.SIGTERM):
            before = signal.signal(one, lambda *_: sender.cancel())
            stack.callback(signal.signal, one, before)
        sender.run()
        keeper.close()
    _conclude(host, keeper)


def _from(lines: Iterator[Line | None], entry: Entry | None) -> Iterator[Line | None]:
    """Yield a job's lines; after `entry`, first what brings the printer back to where it was."""
    from gcodectl.link.job import Line
    from gcodectl.link.resume import State

    if entry is None:
        yield from lines
        return
    state, restored = State(), False
    for line in lines:
        if line is not None and line.source <= entry.line:
            state.take(line.command)
            continue
        if line is not None and not restored:
            restored = True
            for command in state.lines(entry.pulled):
                yield Line(entry.line, command)
        yield line


def _broken_off(job: Job, *, yes: bool) -> Entry:
    """Return where the job broke off, after asking whether to go on there."""
    import os

    from gcodectl.cli.common import STDIN
    from gcodectl.errors import CancelledError, InputError
    from gcodectl.link.journal import digest, journal_path, read

    if job.source == STDIN:
        raise UsageError("--resume takes a FILE: what came down a pipe is gone")
    path = Path(job.source)
    entry = read(journal_path(path, dict(os.environ)))
    if entry.digest != digest(path, job.how()):
        raise InputError("the file, or how it is filtered, has changed since it broke off", source=job.source)
    typer.echo(
        f"gcodectl: {job.source} broke off after line {entry.line}, the last that the printer acknowledged. "
        "Acknowledged is not deposited: up to some 20 moves before it may be missing. It goes on from there without "
        "homing, so the printer must not have been switched off or moved by hand; heaters are brought up first.",
        err=True,
    )
    if not yes and not typer.confirm("Go on?", err=True):
        raise CancelledError("not resumed")
    return entry


class _Keeper:
    """Keeps the journal of a file's job."""

    def __init__(self, job: Job, host: Host, first: int) -> None:
        import os

        from gcodectl.cli.common import STDIN
        from gcodectl.link.journal import digest, journal_path

        self.path = None if job.source == STDIN else journal_path(Path(job.source), dict(os.environ))
        self._digest = "" if job.source == STDIN else digest(Path(job.source), job.how())
        self._job, self._host, self._written, self._next = job, host, first, 0.0

    def turn(self, *, last: bool = False) -> None:
        """Write how far the job is, now and then."""
        import time

        from gcodectl.link.journal import EVERY, Entry, write

        now, reached = time.monotonic(), self._host.reached
        if self.path is None or reached <= self._written or (now < self._next and not last):
            return
        self._next, self._written = now + EVERY, reached
        stopping = self._host.stopping
        pulled = self._job.pull_back if stopping is not None and stopping.orderly else 0.0
        entry = Entry(str(Path(self._job.source).resolve()), self._digest, reached, self._job.lines, pulled)
        try:
            write(self.path, entry)
        except OSError as error:
            self._host.notes.append(f"the journal cannot be kept ({error}): --resume will not know of this job")
            self.path = None

    def close(self) -> None:
        """Write the last entry, or remove the journal of a job that is done."""
        from gcodectl.link.journal import remove

        if self.path is None:
            return
        if self._host.failure is None:
            remove(self.path)
        else:
            self._written = -1
            self.turn(last=True)


def _conclude(host: Host, keeper: _Keeper) -> None:
    """Raise what ended the job early, with what is to be known about it."""
    failure = host.failure
    if failure is None:
        return
    words = [str(failure)]
    if not host.safe:
        words.append("the printer did not confirm that its heaters are off: see to it, or switch it off")
    if keeper.path is not None and host.reached:
        words.append(f"line {host.reached} was the last acknowledged; `--resume` goes on after it")
    failure.args = ("; ".join(words),)
    raise failure


def _show_plan(job: Job, *, as_json: bool) -> None:
    """Say what would be sent."""
    import json

    from gcodectl.cli.common import duration, source_name

    total = job.timeline.total if job.timeline else None
    if as_json:
        plan = {"event": "plan", "source": job.source, "lines": job.lines, "time_s": total, "pull_back": job.pull_back}
        typer.echo(json.dumps(plan))
        return
    if job.lines is None or total is None:
        typer.echo("standard input is read as it is sent: nothing to say before")
        return
    stop = f"{job.pull_back:.2f} mm of E pulled back" if job.pull_back else "no pull-back known"
    typer.echo(
        f"{source_name(job.source)}: {job.lines} commands to send, {duration(total)} of motion; at a stop {stop}"
    )
