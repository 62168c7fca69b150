"""The speed bench's targets (issue 5), and its tables for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from speed_bench.cells import Cell, by

WIDE = 150
"""Columns of text where nobody's terminal says how many there are."""
CLASS = 48.0
"""MB: a file of the 62 MB class; what was measured on less says so in its row."""


def targets(cells: Sequence[Cell], startup: Sequence[Cell] = (), first: Sequence[Cell] = ()) -> list[Cell]:
    """Return the rows of issue 5's targets that this bench measures; none for what was not run."""
    rows = []
    for stage, least, words in (
        ("check", 60.0, "check"),
        ("learned", 25.0, "filter, learned (aim 60)"),
    ):
        for cell in cells:
            if (cell["family"], cell["stage"], cell["role"]) == ("real", stage, "small"):
                rows.append(_row(f"{words}, real file of {cell['input_mb']:.3g} MB", cell.get("mb_s"), "MB/s", least))
    for cell in cells:
        if (cell["family"], cell["stage"]) == ("paste", "learned"):
            name = f"filter, learned, paste part of {cell['input_mb']:.3g} MB"
            rows.append(_row(name, cell.get("lines_out_s"), "output lines/s", 300_000.0))
    rows += _memory(cells)
    most = {"gcodectl --help": 0.2, "filter of an empty file": 0.8}
    for one in startup:
        limit = next(value for name, value in most.items() if one["name"].startswith(name))
        value = None if one["error"] else one["startup_s"]
        rows.append(_row(f"start-up: {one['name']}", value, "s", limit, at_most=True))
    for one in first:
        value = None if one["error"] else one["first_s"]
        rows.append(_row("first run after installing, compiling", value, "s", 30.0, at_most=True))
        told = one["says_so"] and not one["says_so_again"] and not one["error"]
        rows.append(_row("it says that it is compiling, once", float(told), "of 1", 1.0))
    return rows


def _memory(cells: Sequence[Cell]) -> list[Cell]:
    rows = []
    peaks = [cell["peak_mb"] for cell in cells if "peak_mb" in cell and cell["stage"] != "simulate"]
    if peaks:
        rows.append(_row("peak memory, any file, any command", max(peaks), "MB", 300.0, at_most=True))
    for stage in ("check", "tasks", "neutral", "learned"):
        small, large = (by(cells, family="real", stage=stage, role=role) for role in ("small", "large"))
        if small and large:
            apart = large["input_mb"] > 1.5 * small["input_mb"]
            ratio = large["peak_mb"] / small["peak_mb"] if apart else None
            name = f"memory of {stage}, {large['input_mb']:.3g} MB over {small['input_mb']:.3g} MB"
            rows.append(_row(name, ratio, "x", 1.1, at_most=True))
    return rows


def _row(name: str, value: float | None, unit: str, target: float, at_most: bool = False) -> Cell:
    met = value is not None and (value <= target if at_most else value >= target)
    return {"name": name, "value": value, "unit": unit, "target": target, "met": bool(met)}


def show(found: dict[str, Any]) -> None:
    """Print the tables."""
    from rich.console import Console

    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(width=WIDE, highlight=False)
    if found["cells"]:
        console.print(_cells(found["cells"]))
    for cell in found["cells"]:
        if "error" in cell:
            console.print(f"FAILED {cell['stage']}, {cell['family']}: {cell['error']}", markup=False)
        elif cell["cut"]:
            console.print(
                f"cut to {cell['input_mb']:.3g} MB: {cell['stage']}, {cell['family']}, "
                f"{cell['wanted_mb']:g} MB would take {cell['wanted_s']:.0f} s"
            )
    for one in found["startup"]:
        console.print(f"{one['name']}: {one['startup_s']:.3f} s [{one['least_s']:.3f}, {one['most_s']:.3f}]")
    for one in found["first_run"]:
        console.print(f"{one['name']}: {one['first_s']:.1f} s, the next {one['second_s']:.1f} s {one['error']}")
    if found["peers"]:
        console.print(_peers(found["peers"]))
    for row in found["targets"]:
        value = "not measured" if row["value"] is None else f"{row['value']:.4g} {row['unit']}"
        console.print(f"{'met   ' if row['met'] else 'MISSED'} {row['name']}: {value} (target {row['target']:g})")


def _cells(cells: Sequence[Cell]) -> Any:
    from rich.table import Table

    table = Table(title="each a process of its own, from a file to the null device; medians")
    headings = (
        "input",
        "command",
        "MB",
        "lines",
        "s",
        "MB/s",
        "warm",
        "marginal",
        "lines/s",
        "lines out/s",
        "peak, MB",
    )
    for number, heading in enumerate(headings):
        table.add_column(heading, justify="left" if number < 2 else "right")
    for cell in cells:
        about = (cell["family"], cell["stage"], f"{cell['input_mb']:.2f}", f"{cell['lines']:,}")
        if "error" in cell:
            table.add_row(*about, "FAILED")
            continue
        warm, marginal = (f"{value:.3g}" if (value := cell.get(f"{of}_mb_s")) else "" for of in ("warm", "marginal"))
        out = f"{cell['lines_out_s']:,.0f}" if "lines_out_s" in cell else ""
        table.add_row(
            *about, f"{cell['wall_s']:.2f}", f"{cell['mb_s']:.3g}", warm, marginal,
            f"{cell['lines_s']:,.0f}", out, f"{cell['peak_mb']:.0f}",
        )  # fmt: skip
    return table


def _peers(peers: Sequence[Cell]) -> Any:
    from rich.table import Table

    table = Table(title="beside it, on the real file; ours over theirs in MB/s (they only read)")
    for number, heading in enumerate(("peer", "MB", "MB/s", "peak, MB", "check", "neutral", "learned", "remark")):
        table.add_column(heading, justify="left" if number in (0, 7) else "right")
    for one in peers:
        remark = one.get("skipped") or one.get("error") or ""
        numbers = [f"{one[name]:.3g}" if name in one else "" for name in ("input_mb", "mb_s", "peak_mb")]
        ratios = [f"{one[name]:.3g}x" if name in one else "" for name in ("check_over", "neutral_over", "learned_over")]
        table.add_row(one["peer"], *numbers, *ratios, remark)
    return table
