"""The link bench's targets, and its tables for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

Cell = dict[str, Any]
WIDE = 140
"""Columns of text where nobody's terminal says how many there are."""
STATED = 35.0
"""s: 20 of silence from a printer that says when it is busy, and 10 to make it safe, and what is waited for before."""


def targets(cells: Sequence[Cell]) -> list[Cell]:
    """Return the rows of issue 4's targets."""
    faults = [cell for cell in cells if "jobs" in cell]
    rows = []
    for window in sorted({cell["window"] for cell in faults}):
        mine = [cell for cell in faults if cell["window"] == window]
        wrong = sum(cell["WRONG"] for cell in mine)
        jobs = sum(cell["jobs"] for cell in mine)
        rows.append(_row(f"jobs that went wrong, window {window}, of {jobs}", wrong, "jobs", 0, wrong == 0))
        longest = max(cell["stall_s"] for cell in mine)
        rows.append(_row(f"longest stall, window {window}", longest, "s", STATED, longest <= STATED))
    least = {
        "throughput, window 1, replies 0 ms late": 0.8,
        "throughput, window 4, replies 0 ms late": 2.0,
        "throughput, window 4, replies 4 ms late": 3.5,
    }
    for cell in cells:
        if cell.get("name") in least:
            wanted = least[cell["name"]]
            rows.append(_row(f"{cell['name']}, over a bare loop", cell["ratio"], "x", wanted, cell["ratio"] >= wanted))
        elif str(cell.get("name", "")).startswith("load"):
            rows.append(_row(cell["name"], cell["share"], "of a core", 0.15, cell["share"] <= 0.15))
        elif "starved" in cell and cell["window"] == 1 and cell["latency_s"] <= 0.001:
            name = f"times the planner ran dry, {cell['file']} filtered at {cell['baud']:.0f} baud"
            rows.append(_row(name, cell["starved"], "times", 0, cell["starved"] == 0))
    return rows


def _row(name: str, value: float, unit: str, target: float, met: bool) -> Cell:
    return {"name": name, "value": value, "unit": unit, "target": target, "met": bool(met)}


def show(cells: Sequence[Cell], rows: Sequence[Cell], setting: Cell) -> None:
    """Print the tables."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=WIDE)
    faults = [cell for cell in cells if "jobs" in cell]
    for window in sorted({cell["window"] for cell in faults}):
        console.print(_faults([cell for cell in faults if cell["window"] == window], setting))
    if starving := [cell for cell in cells if "starved" in cell]:
        console.print(_starving(starving))
    for cell in cells:
        if "ratio" in cell:
            console.print(
                f"{cell['name']}: {cell['ratio']:.2f}x [{cell['least']:.2f}, {cell['most']:.2f}] "
                f"of a bare loop's {cell['bare_lines_s']:.0f} lines/s"
            )
        elif "share" in cell:
            console.print(f"{cell['name']}: {cell['share']:.1%} of a core")
    if peers := [cell for cell in cells if "peer" in cell]:
        console.print(_peers(peers))
    for row in rows:
        found = f"{row['value']:.4g} {row['unit']}"
        console.print(f"{'met   ' if row['met'] else 'MISSED'} {row['name']}: {found} (target {row['target']})")
    for cell in faults:
        for job in cell["wrong"]:
            console.print(f"WRONG {cell['fault']}, window {cell['window']}: {job}")


def _faults(cells: Sequence[Cell], setting: Cell) -> Table:
    table = Table(title=f"jobs of {setting['commands']} commands, window {cells[0]['window']}")
    for heading in (
        "fault",
        "jobs",
        "done",
        "ended rightly",
        "WRONG",
        "lines sent again",
        "strays",
        "longest stall, s",
    ):
        table.add_column(heading, justify="left" if heading == "fault" else "right")
    for cell in cells:
        numbers = [cell[name] for name in ("jobs", "done", "ended", "WRONG", "resent", "strays")]
        table.add_row(cell["fault"], *map(str, numbers), f"{cell['stall_s']:.1f}")
    return table


def _starving(cells: Sequence[Cell]) -> Table:
    table = Table(title="filtered on its way: what the printer's planner has in hand")
    headings = ("file", "baud", "ms each way", "window", "lines", "motion, s", "ran dry", "for, s", "least buffered, s")
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "file" else "right")
    for cell in cells:
        table.add_row(
            cell["file"], f"{cell['baud']:.0f}", f"{cell['latency_s'] * 1000:g}", str(cell["window"]),
            str(cell["lines"]), f"{cell['motion_s']:.1f}", str(cell["starved"]), f"{cell['starved_s']:.2f}",
            f"{cell['least_buffered_s']:.3f}",
        )  # fmt: skip
    return table


def _peers(cells: Sequence[Cell]) -> Table:
    table = Table(title="a fault at line 150 of 300: every command once (exact), or how it ended")
    names = list(dict.fromkeys(cell["peer"] for cell in cells))
    for heading in ("fault", *names):
        table.add_column(heading)
    for fault in dict.fromkeys(cell["fault"] for cell in cells):
        found = {cell["peer"]: cell["verdict"][:40] for cell in cells if cell["fault"] == fault}
        table.add_row(fault, *(found.get(name, "") for name in names))
    return table
