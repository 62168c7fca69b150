"""`gcodectl stream`: a file, filtered on the way if asked, down a serial link to a printer."""

from __future__ import annotations

from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcodectl.cli.options import Thermal
from gcodectl.errors import NoPortError, UsageError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from contextlib import ExitStack

    from gcodectl.cli.jobs import Job
    from gcodectl.link.journal import Entry
    from gcodectl.link.sender import Log, Sender
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
    thermal: Thermal = None,
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
    from gcodectl.cli.broken_off import confirm, find
    from gcodectl.cli.common import filter_options
    from gcodectl.cli.compiling import announce_compiling
    from gcodectl.cli.jobs import prepare
    from gcodectl.link.transport import AUTO, find_port

    settings = _settings(window, rx_bytes)
    if baud < 1:
        raise UsageError(f"--baud {baud}: it must be positive")
    for option in ("--material" if material else "", "--thermal" if thermal else ""):
        if option and not filtered:
            raise UsageError(f"{option} goes with --filter")
    if yes and not resume:
        raise UsageError("--yes goes with --resume")
    options = (
        filter_options(file, machine, material or ["neutral"], "model", quality, "replace", False, thermal)
        if filtered
        else None
    )
    announce_compiling()
    job = prepare(file, machine, options)
    entry = find(job) if resume else None
    if dry_run:
        _show_plan(job, entry, as_json=as_json)
        return
    if entry:
        confirm(job, entry, yes=yes)
    _stream(job, settings, (find_port() if port == AUTO else port, baud), log, entry, as_json=as_json)


def _settings(window: str, rx_bytes: int) -> Settings:
    from gcodectl.link.settings import AUTO, Settings

    if window != "auto" and not (window.isdigit() and int(window) > 0):
        raise UsageError(f"--window {window}: write a number from 1 on, or auto")
    return Settings(window=AUTO if window == "auto" else int(window), rx_bytes=rx_bytes)


def _stream(
    job: Job, settings: Settings, port: tuple[str, int], log: Path | None, entry: Entry | None, *, as_json: bool
) -> None:
    import dataclasses
    import time
    from contextlib import ExitStack, closing

    from gcodectl.cli.broken_off import Keeper, conclude
    from gcodectl.cli.show_stream import Shown
    from gcodectl.link.host import Host
    from gcodectl.link.resume import Resumed
    from gcodectl.link.sender import Sender
    from gcodectl.link.transport import open_port

    settings = dataclasses.replace(settings, pull_back=job.pull_back, resumed=entry is not None)
    with ExitStack() as stack:
        writer = _open_log(log, stack) if log else None
        lines = stack.enter_context(closing(job.open()))
        resumed = Resumed(lines, entry.line, entry.pulled) if entry else None
        host = Host(resumed or lines, settings, time.monotonic())
        keeper = Keeper(job, host, entry, resumed)
        shown = Shown(job, host, as_json=as_json, first=entry.line if entry else 0)
        stack.callback(shown.close)

        def turn() -> None:
            keeper.turn()
            shown.turn()

        sender = Sender(host, lambda: open_port(*port), log=writer, on_turn=turn)
        stack.enter_context(_cancelled_by_signals(sender))
        try:
            sender.run()
        except NoPortError as error:
            host.failure = error
            raise
        keeper.close()
        shown.turn()
    conclude(host, keeper, f"{port[0]} at {port[1]} baud")


def _open_log(path: Path, stack: ExitStack) -> Log:
    from gcodectl.link.sender import Log

    if path.is_dir() or not path.absolute().parent.is_dir():
        raise UsageError(f"--log {path}: name a file, in a folder that is there")
    file = path.open("wb")
    log = Log(file)

    def close() -> None:
        with suppress(OSError):  # the log has said so
            file.close()

    stack.callback(close)
    return log


@contextmanager
def _cancelled_by_signals(sender: Sender) -> Iterator[None]:
    """Have signals end the job in good order; Ctrl-C again at once. A terminal that goes away is a signal too."""
    import signal

    before = {signal.SIGINT: signal.signal(signal.SIGINT, lambda *_: sender.cancel())}
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)  # there is no SIGHUP on Windows
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:  # as nohup has it
            before[number] = signal.signal(number, lambda *_: sender.cancel(insist=False))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _show_plan(job: Job, entry: Entry | None, *, as_json: bool) -> None:
    """Say what would be sent."""
    import json

    from gcodectl.cli.common import duration, source_name

    total = job.timeline.total if job.timeline else None
    if as_json:
        plan = {"event": "plan", "source": job.source, "lines": job.lines, "time_s": total, "pull_back": job.pull_back,
                "resume_after": entry.line if entry else None}  # fmt: skip
        typer.echo(json.dumps(plan))
        return
    if job.timeline is None or total is None:
        typer.echo("standard input is read as it is sent: nothing to say before")
        return
    on = f"; goes on after line {entry.line}, with {duration(job.timeline.left(entry.line))} left" if entry else ""
    stop = f"E is pulled back {job.pull_back:.2f} mm" if job.pull_back else "E is not pulled back"
    typer.echo(
        f"{source_name(job.source)}: {job.lines} commands to send, {duration(total)} of motion{on}; "
        f"if it is stopped, {stop}"
    )
