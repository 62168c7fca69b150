"""Prints FILE to PORT with mecode writing directly; run by the peers' Python. The last line is one JSON object.

mecode waits for a line with `ok` in it when it opens a port itself (boards with an SD card say one as they boot); a
port that is handed over open it takes as it is.
"""

from __future__ import annotations

import json
import sys
import time

import serial
from mecode import G
from mecode.printer import Printer


def main(port: str, file: str) -> str:
    """Print, and return how that ended; what hangs is ended from outside."""
    g = G(direct_write=True, direct_write_mode="serial", print_lines=False, aerotech_include=False, setup=False)
    with serial.Serial(port, 115200, timeout=0.5) as line:
        g._p = Printer(port, 115200)
        g._p.connect(line)
        g._p.start()
        begun = time.monotonic()
        with open(file, encoding="latin-1") as lines:
            for text in lines:
                g.write(text.strip())
        g.teardown(wait=True)
        print(json.dumps({"errors": [], "printing_s": time.monotonic() - begun}))
    return "finished"


if __name__ == "__main__":
    print(json.dumps({"ended": main(*sys.argv[1:])}), flush=True)
