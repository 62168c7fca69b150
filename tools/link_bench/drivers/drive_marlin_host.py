"""Prints FILE to PORT with marlin-host in its reliable mode; run by the peers' Python. Ends with one JSON object."""

from __future__ import annotations

import json
import sys
import time

from marlin_host import HostError, MarlinHost, SerialTransport


def main(port: str, file: str) -> str:
    """Print, and return how that ended."""
    host = MarlinHost(SerialTransport(port, 115200, reset_on_open=False), reliable=True)
    try:
        host.connect()
        with open(file, encoding="ascii", errors="replace") as lines:
            begun = time.monotonic()
            for _ in host.stream(lines):
                pass
        print(json.dumps({"errors": [], "printing_s": time.monotonic() - begun}))
    except HostError as error:
        return f"{type(error).__name__}: {error}"
    finally:
        host.close()
    return "finished"


if __name__ == "__main__":
    print(json.dumps({"ended": main(*sys.argv[1:])}), flush=True)
