"""A printer that does nothing but answer: `ok` a line, at once or a while later. Run as a script, on its own process.

responder.py LATENCY [RATE]     prints the pty's name, then answers each line LATENCY s after it came, RATE a second
                                at most, until the other side is gone
"""

from __future__ import annotations

import os
import select
import sys
import time
import tty
from collections import deque


def serve(latency: float, rate: float) -> None:
    """Answer on a pty of our own until the other side has come and gone."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    print(os.ttyname(theirs), flush=True)
    spacing = 1.0 / rate if rate else 0.0
    due: deque[float] = deque()
    free_at = 0.0
    while True:
        wait = max(0.0, due[0] - time.perf_counter()) if due else 60.0
        if wait > 0.0 and select.select([ours], [], [], wait)[0]:
            data = os.read(ours, 4096)
            lines = data.count(b"\n") - data.startswith(b"\n")  # a host's first, empty line has no answer
            for _ in range(lines):
                free_at = max(time.perf_counter() + latency, free_at + spacing)
                due.append(free_at)
        ready = 0
        now = time.perf_counter()
        while due and due[0] <= now:
            due.popleft()
            ready += 1
        if ready:
            os.write(ours, b"ok\n" * ready)


if __name__ == "__main__":
    serve(float(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 0.0)
