"""Every fault, many times a job, many jobs: was each command executed exactly once, or the job ended rightly?

A job is a host against a virtual printer under a virtual clock (`plant_models.printer.duel`): the host that
`gcodectl stream` runs, the queue and the faults that `gcodectl virtual-printer` serves. The fault strikes a few times a
job at seeded random places, another one, drawn for the seed, now and then besides; the firmware's differences (ok after
Resend, duplicates dropped, ADVANCED_OK, emergency parser, `wait`) are drawn for the seed too.

done     every command executed exactly once and in order, and the host said so
ended    the host ended the job with the right exit status; what was executed is the job's beginning, each once; the
         printer's heaters are off, or it has halted
WRONG    anything else
"""

from __future__ import annotations

import math
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise
from random import Random
from typing import Any

from gcodectl.config import load_machine
from gcodectl.errors import CancelledError, DisconnectedError, FirmwareError, NoAnswerError
from gcodectl.link.dialect import Dialect
from gcodectl.link.host import Host
from gcodectl.link.job import BASE, Line
from gcodectl.link.settings import Settings
from plant_models.printer.duel import duel
from plant_models.printer.faults import KINDS, parse_faults
from plant_models.printer.virtual import VirtualPrinter

ENDING: dict[str, tuple[type, ...]] = {
    "dead": (NoAnswerError,), "reset": (FirmwareError,), "kill": (FirmwareError,), "thermal": (FirmwareError,),
    "close": (DisconnectedError,), "cancel": (CancelledError,),
}  # fmt: skip
"""Faults that end a job, and the errors that say so; each strikes once."""
OTHERS = (
    "lost-line", "checksum", "missing-checksum", "duplicate-resend", "garble-in", "future-resend", "noise", "lost-ok",
    "garble-out", "split-ok", "join-ok", "slow-ok",
)  # fmt: skip
PER_JOB = 6.0
"""Times a fault strikes a job, on average."""
PIECE = 8
"""Bytes that arrive at once where the window is more than one: a printer may then find half a line."""
HOT = b"M104 S200"


def one_job(fault: str, seed: int, commands: int, window: int) -> dict[str, Any]:
    """Print one job; returns how it went."""
    random = Random(f"{fault} {seed}")
    dialect = Dialect(
        drop_repeats=random.random() < 0.5, ok_after_resend=random.random() < 0.5, advanced_ok=random.random() < 0.3,
        emergency_parser=random.random() < 0.5, wait=random.choice([0.0, 1.0]),
    )  # fmt: skip
    lines = [Line(1, HOT), *(Line(i + 1, b"G1 X%d Y%.2f E%.3f" % (i, i % 7, i / 50)) for i in range(1, commands))]
    spec = f"{_struck(fault, commands, random)},{random.choice(OTHERS)}%{2.0 / commands:g}"
    host = Host(lines, Settings(window=window))
    printer = VirtualPrinter(load_machine("syringe"), dialect=dialect, faults=parse_faults(spec), seed=seed)
    took = duel(host, printer, cut=_whole if window == 1 else _pieces)
    wanted = {line.command for line in lines}
    laid = [one for one in printer.executed if one.text in wanted]
    times = [one.t for one in laid] or [0.0]
    stall = max((later - earlier for earlier, later in pairwise(times)), default=0.0)
    right = [line.command for line in lines[: len(laid)]] == [one.text for one in laid]
    thermals = printer.commands.thermals
    cold = not printer.alive or all(heater.target <= 0 for heater in (*thermals.hotends, thermals.bed))
    if host.failure is None:
        outcome = "done" if right and len(laid) == len(lines) and took < math.inf else "WRONG"
    else:
        classes = ENDING.get(fault, (FirmwareError,))
        outcome = "ended" if right and cold and isinstance(host.failure, classes) else "WRONG"
    return {
        "outcome": outcome, "resent": host.outbox.resent, "stall_s": max(stall, took - times[-1]), "spec": spec,
        "error": str(host.failure) if host.failure else None, "seed": seed, "strays": _strays(printer, lines),
    }  # fmt: skip


def _whole(data: bytes) -> list[bytes]:
    return [data]


def _pieces(data: bytes) -> list[bytes]:
    return [data[k : k + PIECE] for k in range(0, len(data), PIECE)]


def _struck(fault: str, commands: int, random: Random) -> str:
    """Say where the fault strikes a job; a bogus request is for a line a little or far back."""
    if fault in ENDING:
        return f"{fault}@{BASE + random.randrange(10, commands)}"
    if fault == "bogus-resend":
        lines = [BASE + random.randrange(40, commands) for _ in range(round(PER_JOB))]
        return ",".join(f"{fault}={line - random.choice([0, 1, 2, 5, 12, 30, line - 1])}@{line}" for line in lines)
    return f"{fault}%{PER_JOB / commands:g}"


def _strays(printer: VirtualPrinter, lines: list[Line]) -> int:
    """Count what was executed and is neither the job's nor the link's: lines damaged so that they looked bare."""
    own = (b"M104", b"M105", b"M107", b"M108", b"M110", b"M113", b"M115", b"M140", b"M155", b"M400", b"M410")
    known = {line.command for line in lines}
    return sum(one.text not in known and not one.text.startswith(own) for one in printer.executed)


def measured_faults(seeds: int, commands: int, window: int, processes: int, first: int = 0) -> list[dict[str, Any]]:
    """Return a cell a fault, over the seeds."""
    work = [(fault, first + seed, commands, window) for fault in KINDS if fault != "resume" for seed in range(seeds)]
    with ProcessPoolExecutor(processes) as pool:
        found = list(pool.map(_one, work, chunksize=4))
    cells = []
    for fault in dict.fromkeys(one[0] for one in work):
        mine = [job for (name, *_), job in zip(work, found, strict=True) if name == fault]
        count = {name: sum(job["outcome"] == name for job in mine) for name in ("done", "ended", "WRONG")}
        cells.append({
            "fault": fault, "window": window, "jobs": len(mine), "commands": commands, **count,
            "resent": sum(job["resent"] for job in mine), "stall_s": max(job["stall_s"] for job in mine),
            "strays": sum(job["strays"] for job in mine),
            "wrong": [job for job in mine if job["outcome"] == "WRONG"][:3],
        })  # fmt: skip
    return cells


def _one(work: tuple[str, int, int, int]) -> dict[str, Any]:
    return one_job(*work)
