"""Prefetch: the first stages of a stream in a thread of their own, so that two cores share the work.

    thread   | read parse modal |  chunk 1  |  chunk 2  |  chunk 3  |
                                     \\           \\           \\        at most MOST chunks wait
    caller   | plan profile ... |            | chunk 1  |  chunk 2  | ...

The kernels let go of Python's lock, so both sides really run at once. What comes out is what went in, in order, as soon
as it is there; an error of the thread's side is raised where its chunk would have come.
"""

from __future__ import annotations

import queue
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

Item = TypeVar("Item")

MOST = 2
"""Chunks that may wait, beside the one in hand on either side."""
SWITCH = 2e-4
"""s; how long a thread that comes back from a kernel waits for Python's lock before it asks for it. Python's own 5 ms
are as long as a stage takes for a chunk: a core would stand still meanwhile."""


class _Failed:
    """What the thread's side raised."""

    def __init__(self, error: BaseException) -> None:
        self.error = error


class _Line(Generic[Item]):
    """A queue between two threads that either side may end."""

    def __init__(self) -> None:
        self.items: queue.Queue[Item | _Failed | None] = queue.Queue(MOST)
        self.closed = threading.Event()

    def fill(self, source: Iterator[Item]) -> None:
        """Put everything that comes into the queue, then None; or what went wrong."""
        last: _Failed | None = None
        try:
            for item in source:
                self.items.put(item)
                if self.closed.is_set():
                    break
        except BaseException as error:  # noqa: BLE001 - it is raised again, in the caller's thread
            last = _Failed(error)
        if not self.closed.is_set():  # else nobody makes room any more
            self.items.put(last)

    def close(self) -> None:
        """Let the filling side go: it finds room, and sees that nobody wants more."""
        self.closed.set()
        while not self.items.empty():
            self.items.get_nowait()


def prefetch(source: Iterator[Item], weight: Callable[[Item], int] = lambda _: 1, after: int = 0) -> Iterator[Item]:
    """Yield what `source` yields, which runs in a thread of its own; raises what it raises.

    The thread begins once items of `weight` more than `after` have come: what is short needs none. It ends with the
    source, or with its next item after this generator has been closed. A source that waits for input that never comes
    keeps the thread, which does not keep the process.
    """
    seen = 0
    while seen <= after:
        if (item := next(source, None)) is None:
            return
        yield item
        seen += weight(item)
    line: _Line[Item] = _Line()
    sys.setswitchinterval(min(sys.getswitchinterval(), SWITCH))
    threading.Thread(target=line.fill, args=(source,), name="prefetch", daemon=True).start()
    try:
        while (ready := line.items.get()) is not None:
            if isinstance(ready, _Failed):
                raise ready.error
            yield ready
    finally:
        line.close()
