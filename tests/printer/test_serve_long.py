"""A command that takes longer than any clock can wait for: the printer still listens."""

from __future__ import annotations

import math
import threading

import pytest
import serial
from printing_hosts import MACHINE

from gcodectl.link.dialect import Dialect
from plant_models.gantry import Firmware
from plant_models.printer.live import Live
from plant_models.printer.ports import TcpPort
from plant_models.printer.serve import Server
from plant_models.printer.virtual import VirtualPrinter

PATIENCE = 30.0


@pytest.mark.parametrize("speed", [1.0, math.inf])
def test_a_move_of_ages_leaves_the_printer_listening(speed: float):
    one = VirtualPrinter(MACHINE, dialect=Dialect(greeting=False, keepalive=0), motion=Live(MACHINE, Firmware()))
    port, ready = TcpPort("127.0.0.1", 0), threading.Event()
    server = Server(one, port, speed=speed)
    thread = threading.Thread(target=server.run, kwargs={"ready": ready.set})
    thread.start()
    try:
        assert ready.wait(PATIENCE)
        with serial.serial_for_url(port.name, timeout=PATIENCE) as there:
            there.write(b"G1 F.0001\nG1 X10000000\nM400\n")
            assert [there.readline() for _ in range(2)] == [b"ok\n"] * 2
            there.write(b"M112\n")
            answers = iter(there.readline, b"")
            assert any(line.startswith(b"Error:Printer halted") for line in answers)
    finally:
        server.stop()
        thread.join(PATIENCE)
    assert not thread.is_alive()
    assert not one.alive
