"""Prints FILE to PORT with Printrun's printcore; run by the peers' Python. The last line is one JSON object."""

from __future__ import annotations

import json
import sys
import threading
import time

from printrun import gcoder
from printrun.printcore import printcore

ONLINE_S = 15.0


def main(port: str, file: str) -> str:
    """Print, and return how that ended; what hangs is ended from outside."""
    errors: list[str] = []
    core = printcore()
    core.errorcb = errors.append
    core.connect(port, 115200)
    begun = time.monotonic()
    while not core.online:
        if time.monotonic() - begun > ONLINE_S:
            return "no answer from the printer"
        time.sleep(0.01)
    with open(file, encoding="latin-1") as lines:
        job = gcoder.LightGCode(lines.read().splitlines())
    begun = time.monotonic()
    if not core.startprint(job):
        return "would not start"
    while core.printing:
        time.sleep(0.005)
    took = time.monotonic() - begun
    # Its last act is to start printcore's sender anew, which leaving must find started; `core.print_thread` is None
    # some lines before that, so the thread itself is asked for.
    for printing in threading.enumerate():
        if printing.name == "print thread":
            printing.join()
    core.disconnect()
    print(json.dumps({"errors": [one.strip() for one in errors], "printing_s": took}))
    return "finished"


if __name__ == "__main__":
    print(json.dumps({"ended": main(*sys.argv[1:])}), flush=True)
