"""What gcodectl has filtered already: how that is told by the comments that it wrote."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

PROGRAM = b"; gcodectl"
SIGNATURE = re.compile(rb"^; gcodectl(?=: changed from here on|: learned flow begins here| \d+\.\d)", re.MULTILINE)
"""How the comments begin that say that gcodectl has filtered a file: where it first changed it (in older files: where
learned flow begins), and at its end."""


def is_filtered(tail: bytes) -> bool:
    """Whether the last bytes of a file say that gcodectl has filtered it."""
    return SIGNATURE.match(tail.rstrip(b"\r\n").rpartition(b"\n")[2]) is not None


class Fresh:
    """Chunks up to the first line that gcodectl wrote; what comes from there on stays in `rest` and `chunks`."""

    def __init__(self, chunks: Iterable[bytes]) -> None:
        self.chunks = iter(chunks)
        self.rest: list[bytes] = []

    def __iter__(self) -> Iterator[bytes]:
        for chunk in self.chunks:
            # a regular expression alone takes ten times as long as finding its first word
            if PROGRAM in chunk and (found := SIGNATURE.search(chunk)):
                self.rest = [chunk[found.start() :]]
                if found.start():
                    yield chunk[: found.start()]
                return
            yield chunk
