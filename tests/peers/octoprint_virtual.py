"""Serves OctoPrint's VirtualPrinter class on a pty; run by the peers' own Python, as OctoPrint is installed there.

    python octoprint_virtual.py LINK LOG BASEDIR BASE

LINK becomes a symbolic link to the pty, LOG gets every line that arrives as it is, BASEDIR holds OctoPrint's settings.
Says `ready` when it listens. Its default simulated_errors (100: resend, 105: resend and then the line is swallowed,
110: an error without Resend or ok, 115: checksum) strike at those lines after BASE, where the host's numbers begin.

The class takes one line a turn even where several wait in one piece, so it is given one line at a time.
"""

from __future__ import annotations

import os
import sys
import threading
import tty
from contextlib import suppress
from pathlib import Path

import octoprint.plugin
import octoprint.settings
from octoprint.plugins.virtual_printer import VirtualPrinterPlugin
from octoprint.plugins.virtual_printer.virtual import VirtualPrinter
from serial import SerialTimeoutException


def main(link: str, log: str, basedir: str, base: str) -> None:
    octoprint.settings.settings(init=True, basedir=basedir)
    octoprint.plugin.plugin_manager(init=True, plugin_folders=[], plugin_bases=[], plugin_entry_points=[])
    defaults = VirtualPrinterPlugin().get_settings_defaults()
    faults = (one.split(":") for one in defaults["simulated_errors"])
    defaults["simulated_errors"] = [f"{int(base) + int(line)}:{kind}" for line, kind in faults]
    settings = octoprint.plugin.plugin_settings("virtual_printer", defaults=defaults)
    near, far = os.openpty()
    tty.setraw(far)
    printer = VirtualPrinter(settings, None, basedir, read_timeout=1.0, write_timeout=0.02)
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
    """Its receive buffer takes what there is room for, and the rest waits; but not within `write`, whose lock it needs
    itself to ask for a line again."""
    while line:
        with suppress(SerialTimeoutException):
            line = line[printer.write(line) :]


def answer(printer: VirtualPrinter, near: int) -> None:
    while True:
        line = printer.readline()
        if line:
            os.write(near, line.rstrip(b"\n") + b"\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
