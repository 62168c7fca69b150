"""Serves OctoPrint's VirtualPrinter class on a pty; run by the peers' own Python, as OctoPrint is installed there.

    python octoprint_virtual.py LINK LOG BASEDIR

LINK becomes a symbolic link to the pty, LOG gets every line that arrives as it is, BASEDIR holds OctoPrint's settings.
Says `ready` when it listens; its default simulated_errors are left as they are (100: resend, 105: resend and then the
line is swallowed, 110: an error without Resend or ok, 115: checksum).

The class takes one line a turn even where several wait in one piece, so it is given one line at a time.
"""

from __future__ import annotations

import os
import sys
import threading
import tty
from pathlib import Path

import octoprint.plugin
import octoprint.settings
from octoprint.plugins.virtual_printer import VirtualPrinterPlugin
from octoprint.plugins.virtual_printer.virtual import VirtualPrinter


def main(link: str, log: str, basedir: str) -> None:
    octoprint.settings.settings(init=True, basedir=basedir)
    octoprint.plugin.plugin_manager(init=True, plugin_folders=[], plugin_bases=[], plugin_entry_points=[])
    settings = octoprint.plugin.plugin_settings(
        "virtual_printer", defaults=VirtualPrinterPlugin().get_settings_defaults()
    )
    near, far = os.openpty()
    tty.setraw(far)
    printer = VirtualPrinter(settings, None, basedir, read_timeout=1.0, write_timeout=3600.0)
    Path(link).symlink_to(os.ttyname(far))
    threading.Thread(target=answer, args=(printer, near), daemon=True).start()
    print("ready", flush=True)
    with Path(log).open("wb", buffering=0) as heard:
        rest = b""
        while data := os.read(near, 4096):
            *lines, rest = (rest + data).split(b"\n")
            for line in lines:
                heard.write(line + b"\n")
                give(printer, line + b"\n")


def give(printer: VirtualPrinter, line: bytes) -> None:
    """Its receive buffer takes as much as there is room for; the rest waits, as on a real port."""
    while line:
        line = line[printer.write(line) :]


def answer(printer: VirtualPrinter, near: int) -> None:
    while True:
        line = printer.readline()
        if line:
            os.write(near, line.rstrip(b"\n") + b"\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
