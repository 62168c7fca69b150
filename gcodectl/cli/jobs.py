"""Makes a job of a file, of a filtered file, or of a pipe: what is to be sent, how long it takes, how to release.

A file is read to its end before the port is opened, and filtered to its end where it is to be filtered: whatever has to
be refused is refused before anything moves. It is filtered a second time while it is sent, a few lines ahead; a pipe is
read as it comes.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Generator, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from gcodectl.errors import InputError, RefusedError, UsageError
from gcodectl.link.ahead import Ahead
from gcodectl.link.job import Line, read_lines

if TYPE_CHECKING:
    from gcodectl.cli.timeline import Timeline
    from gcodectl.pipeline import Options

AHEAD = 256
"""Lines that are ready before they are sent: filtered at some 20 to 100 lines a second of motion, 3 to 13 s."""
PIECE = 4096
"""Bytes that are filtered at once while streaming: so that no piece takes long."""
NOTHING = "holds no command: there is nothing to send"
MOST_PULL = 10.0
"""mm of E; a deeper retraction is an unloading, not what releases pressure."""


@dataclasses.dataclass(frozen=True)
class Job:
    """What `stream` sends."""

    source: str
    lines: int | None
    """How many there are; None for a pipe."""
    timeline: Timeline | None
    pull_back: float
    """mm of E that release the plunger."""
    options: Options | None
    """How it is filtered; None: as it is."""
    stamp: tuple[int, int] | None = None
    """Size and time of the file as it was checked; None for a pipe."""

    def how(self) -> str:
        """Return what tells this filtering from another."""
        if self.options is None:
            return "plain"
        keys = ",".join("neutral" if one is None else one.key for one in self.options.sets)
        text = f"{self.options.machine} {keys} {self.options.sequencer} {self.options.quality}"
        return hashlib.sha256(text.encode()).hexdigest()

    def open(self) -> Ahead[Line] | Generator[Line, None, None]:
        """Begin to read it; gives None where no line is ready yet."""
        from gcodectl.cli.common import STDIN

        if self.source != STDIN and self.options is None:
            return self._read()
        ahead = Ahead(self._read(), AHEAD)
        if self.source != STDIN:
            ahead.wait()
        return ahead

    def _read(self) -> Generator[Line, None, None]:
        from gcodectl.cli.common import STDIN, open_input, source_name
        from gcodectl.gcode.lines import read_chunks
        from gcodectl.pipeline import filter_stream

        with open_input(self.source) as stream:
            # a thread that waits in a buffered standard input would abort the interpreter at its end
            unbuffered = getattr(stream, "raw", stream) if self.source == STDIN else stream
            chunks = self._unchanged(read_chunks(unbuffered, PIECE))
            if self.options is not None:
                chunks = filter_stream(chunks, self.options)
            lines = read_lines(chunks, source_name(self.source))
            first = next(lines, None)
            if first is None:
                raise InputError(NOTHING, source=source_name(self.source))
            yield first
            yield from lines

    def _unchanged(self, chunks: Iterable[bytes]) -> Iterator[bytes]:
        """Pass chunks on; RefusedError where the file is no longer the one that was checked."""
        for chunk in chunks:
            if self.stamp is not None and _stamp(Path(self.source)) != self.stamp:
                raise RefusedError(
                    "was changed while it was printed: what comes now was not checked", source=self.source
                )
            yield chunk


def prepare(source: str, machine: str, options: Options | None) -> Job:
    """Read (and filter) a whole file, and make a job of it; a pipe is made a job unread.

    Raises RefusedError, naming the line, for what must not be sent, and what `filter` raises.
    """
    from gcodectl.cli.common import STDIN

    if source == STDIN:
        return Job(source, None, None, _stored(options), options)
    path = Path(source)
    if path.exists() and not path.is_file() and not path.is_dir():
        raise UsageError(f"{source} can be read but once, as a pipe: write `gcodectl stream - < {source}`")
    stamp = _stamp(path)
    job = _plain(source, machine) if options is None else _filtered(source, options)
    if not job.lines:
        raise InputError(NOTHING, source=source)
    return dataclasses.replace(job, stamp=stamp)


def _stamp(path: Path) -> tuple[int, int] | None:
    """Return a file's size and the time of its last change, ns; None where it is gone, or no file."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_size, found.st_mtime_ns


def _plain(source: str, machine: str) -> Job:
    from gcodectl.cli.common import open_input, reading_options
    from gcodectl.cli.timeline import timeline_of
    from gcodectl.gcode.lines import read_chunks
    from gcodectl.pipeline import read_moves

    with open_input(source) as stream:
        count = sum(1 for _ in read_lines(read_chunks(stream), source))
    options = reading_options(source, machine, pass_unknown=True)
    with open_input(source) as stream:
        timeline, deepest = timeline_of(read_moves(read_chunks(stream), options), options.machine)
    return Job(source, count, timeline, min(deepest, MOST_PULL), None)


def _filtered(source: str, options: Options) -> Job:
    import numpy as np

    from gcodectl.cli.common import open_input
    from gcodectl.cli.timeline import Timeline
    from gcodectl.gcode.lines import read_chunks
    from gcodectl.pipeline import filter_stream
    from gcodectl.summary import Summary

    summary = Summary()
    marks: list[tuple[int, float, int]] = []

    def counted(chunks: Iterable[bytes]) -> Iterator[bytes]:
        written = 0
        for chunk in chunks:
            yield chunk
            written += chunk.count(b"\n")
            marks.append((written, summary.time_s, max(summary.layers - 1, 0)))

    with open_input(source) as stream:
        filtered = filter_stream(read_chunks(stream, PIECE), options, summary)
        count = last = 0
        for line in read_lines(counted(filtered), f"{source}, filtered"):
            count, last = count + 1, line.source
    lines, done, layers = (np.array(column) for column in zip(*marks, strict=True)) if marks else (np.zeros(0),) * 3
    lines = np.minimum(lines, last)  # comments stand after it
    timeline = Timeline(lines.astype(np.int64), done.astype(float), layers.astype(np.int64))
    return Job(source, count, timeline, _stored(options), options)


def _stored(options: Options | None) -> float:
    """Return what the first tool's material stores at its nominal flow, beyond what it keeps at rest, mm of E."""
    from gcodectl.flow.flow_model import stored_kernel

    inversions = options.inversions if options is not None else ()
    first = next((one for one in inversions if one is not None), None)
    if first is None or options is None:
        return 0.0
    parameters = first.model.parameters
    stored = stored_kernel(first.model.flow, parameters) - stored_kernel(0.0, parameters)
    return min(float(stored) / options.machine.area, MOST_PULL)
