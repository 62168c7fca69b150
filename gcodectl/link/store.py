"""Every numbered line that was ever sent, by its number: bytes that never change, so that a resend is a resend."""

from __future__ import annotations

from array import array


class Store:
    """Numbered lines, appended and never altered; holds them in memory, as large as what was sent."""

    def __init__(self, first: int) -> None:
        self.first = first
        """The lowest number."""
        self.next = first
        """The number that the next line will get."""
        self._data = bytearray()
        self._ends = array("Q")
        self._sources = array("Q")

    def append(self, line: bytes, source: int = 0) -> None:
        """Keep the line, numbered `next`, for good; `source`: its line in the file, 0 for none."""
        self._data += line
        self._ends.append(len(self._data))
        self._sources.append(source)
        self.next += 1

    def line(self, number: int) -> bytes:
        """Return the line of that number as it goes over the wire."""
        index = number - self.first
        begin = self._ends[index - 1] if index else 0
        return bytes(self._data[begin : self._ends[index]])

    def holds(self, text: bytes) -> bool:
        """Return whether any line holds `text`."""
        return text in self._data

    def source(self, number: int) -> int:
        """Return the line of the file that it came from; 0 for what the link sends by itself."""
        return self._sources[number - self.first]
