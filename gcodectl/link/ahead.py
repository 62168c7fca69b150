"""Takes from a slow source ahead of time, in a thread, and no further than a stated number of items."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from queue import Empty, Full, Queue
from typing import Generic, TypeVar

T = TypeVar("T")


class Ahead(Generic[T]):
    """An iterator that never waits: it gives the next item, or None where there is none yet.

    At most `most` items are held. What the source raises is raised here, after the items before it.
    """

    def __init__(self, source: Iterable[T], most: int) -> None:
        self._queue: Queue[T | _End] = Queue(most)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._fill, args=(iter(source),), daemon=True)
        self._end: _End | None = None
        self._thread.start()

    def _fill(self, source: Iterator[T]) -> None:
        end = _End(None)
        try:
            for item in source:
                if not self._put(item):
                    return
        except Exception as error:  # noqa: BLE001  handed over to whoever takes the items, who raises it
            end = _End(error)
        self._put(end)

    def _put(self, item: T | _End) -> bool:
        """Put an item where there is room, waiting for it; returns whether it is still wanted."""
        while not self._closed.is_set():
            try:
                self._queue.put(item, timeout=0.2)
                return True
            except Full:
                continue
        return False

    def wait(self) -> None:
        """Wait until it holds all that it may, or the source has ended."""
        while self._thread.is_alive() and not self._queue.full():
            self._thread.join(0.01)

    def close(self) -> None:
        """Let the source be; what is held is dropped."""
        self._closed.set()

    def __iter__(self) -> Iterator[T | None]:
        return self

    def __next__(self) -> T | None:
        if self._end is None:
            try:
                item = self._queue.get_nowait()
            except Empty:
                return None
            if not isinstance(item, _End):
                return item
            self._end = item
        if self._end.error is not None:
            error, self._end = self._end.error, _End(None)
            raise error
        raise StopIteration


class _End:
    """The source has ended; `error`: by this."""

    def __init__(self, error: Exception | None) -> None:
        self.error = error
