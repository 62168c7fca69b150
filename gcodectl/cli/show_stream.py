"""What `stream` shows while it sends: a bar on a terminal, or events as JSON, a line each."""

from __future__ import annotations

import json
import sys
import time
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from gcodectl.cli.jobs import Job
    from gcodectl.link.host import Host

EVERY = 1.0
"""s between two progress events."""


class Shown:
    """Shows one job; call `turn` often."""

    def __init__(self, job: Job, host: Host, *, as_json: bool, first: int = 0) -> None:
        self._job, self._host, self._as_json, self._first = job, host, as_json, first
        self._next = 0.0
        self._phase: Any = None
        self._bar: Any = None
        self._task: Any = None
        if not as_json:
            self._bar, self._task = _bar(job)
        if self._bar is not None:
            self._bar.start()

    def turn(self) -> None:
        """Show what is new."""
        host = self._host
        if host.phase is not self._phase:
            self._phase = host.phase
            self._say({"event": "phase", "phase": host.phase.name.lower()})
        while host.notes:
            note = host.notes.pop(0)
            self._say({"event": "note", "text": note}, f"gcodectl: {note}")
        now = time.monotonic()
        if now >= self._next:
            self._next = now + EVERY
            self._say({"event": "progress", **self.state()})
        if self._bar is not None:
            state = self.state()
            self._bar.update(self._task, completed=state["line"], description=_words(state))

    def state(self) -> dict[str, Any]:
        """Return how far the job is."""
        host, timeline = self._host, self._job.timeline
        line = max(host.reached, self._first)
        heats = {name: [heat.now, heat.target] for name, heat in sorted(host.printer.heats.items())}
        return {
            "line": line,
            "layer": timeline.at(line) if timeline else None,
            "layers": timeline.layers if timeline else None,
            "left_s": round(timeline.left(line), 1) if timeline else None,
            "resent": host.outbox.resent,
            "heats": heats,
        }

    def close(self) -> None:
        """Say how it ended, and leave the terminal in order."""
        if self._bar is not None:
            self._bar.stop()
        failure = self._host.failure
        self._say({
            "event": "end", "ok": failure is None, "error": str(failure) if failure else None,
            "exit_status": failure.exit_status if failure else 0, "safe": self._host.safe, **self.state(),
        })  # fmt: skip

    def _say(self, event: dict[str, Any], words: str = "") -> None:
        if self._as_json:
            sys.stdout.write(json.dumps(event) + "\n")
            sys.stdout.flush()
        elif words:
            typer.echo(words, err=True)


def _bar(job: Job) -> tuple[Any, Any]:
    """Make a progress bar where there is a terminal to see it."""
    if not sys.stderr.isatty():
        return None, None
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

    columns = (BarColumn(bar_width=30), TaskProgressColumn(), TextColumn("{task.description}"))
    bar = Progress(*columns, console=Console(stderr=True), transient=True)
    last = int(job.timeline.line[-1]) if job.timeline is not None and len(job.timeline.line) else None
    return bar, bar.add_task("connecting", total=last)


def _words(state: dict[str, Any]) -> str:
    """Say in a few words how far the job is."""
    from gcodectl.cli.common import duration

    parts = [f"layer {state['layer']}/{state['layers']}" if state["layers"] else f"line {state['line']}"]
    if state["left_s"] is not None:
        parts.append(f"{duration(state['left_s'])} left")
    parts += [
        f"{name} {now:.0f}" + (f"/{target:.0f}" if target else "") for name, (now, target) in state["heats"].items()
    ]
    return ", ".join(parts)
