"""The learning bench's tables for people: a heading a part, a line a cell, and the targets."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from learning_bench.guesses import STARTS
from learning_bench.starts import STARTS as BEGUN

Cell = dict[str, Any]


def _fabathome(cell: Cell) -> str:
    numbers = f"{cell['one_out']:8.3f} {cell['material_out']:13.3f} {cell['over_materials']:11.3f}"
    return f"{cell['files']:11} {cell['parameter']:13} {cell['learner']:16} {numbers}"


def _operator(cell: Cell) -> str:
    told = " | ".join(f"{one['prints']:3} {one['start']}, {one['stop']}" for one in map(cell["starts"].get, STARTS))
    return f"{cell['material']:14} {cell['plant']:17} {cell['seed']:4}  {told}"


def _starts(cell: Cell) -> str:
    told = " | ".join(f"{one['near']:3} {one['rms'][0]:6.3f}" for one in map(cell["starts"].get, BEGUN))
    return f"{cell['material']:14} {cell['plant']:17} {cell['seed']:4}  {told}"


def _loop(cell: Cell) -> str:
    rmse = "failed" if cell["rmse"] is None else f"{cell['rmse']:.4f}"
    told = f"{cell['trials']:6} {cell['best']:4} {cell['ratio']:6.3f} {cell['bound']:6.3f}"
    course = " ".join(f"{value:.3f}" for value in cell["beads"])
    return f"{cell['plant']:17} {cell['seed']:4} {told}  {rmse} ({cell['rmse_of_run']:.4f})  {course}"


def _photographs(cell: Cell) -> str:
    what = f"{cell['material']} on {cell['ground']}"
    told = cell["refused"] or (
        f"{cell['rms']:7.4f} {cell['relative']:8.4f} {cell['bias']:+7.4f}  "
        f"{cell['rms_weighed']:7.4f} {cell['relative_weighed']:8.4f} {cell['grams']:7g} g"
    )
    return f"{cell['nozzle']:6g} {cell['plant']:14} {cell['seed']:4} {what:28} {told}"


def _photo_session(cell: Cell) -> str:
    told = f"{cell['trials']:6} {cell['best']:4} {cell['ratio']:6.3f} {cell['bound']:6.3f}"
    names = ("rmse", "rmse_weighed", "rmse_weighed_once", "rmse_clean")
    rmse, weighed, once, clean = ("failed" if cell[name] is None else f"{cell[name]:.4f}" for name in names)
    widths = " ".join(f"{value:.3f}" for value in cell["widths"])
    return f"{cell['plant']:17} {cell['seed']:4} {told}  {rmse} {weighed} {once} ({clean})  {widths}"


PARTS: Mapping[str, tuple[str, Callable[[Cell], str]]] = {
    "fabathome": (
        f"{'files':11} {'parameter':13} {'learner':16} {'one out':>8} {'material out':>13} {'a material':>11}",
        _fabathome,
    ),
    "operator": (
        f"{'material':14} {'plant':17} seed  prints, and the first one's ends, {' | '.join(STARTS)}",
        _operator,
    ),
    "starts": (f"{'material':14} {'plant':17} seed  trials and the first one's mm^3/s, {' | '.join(BEGUN)}", _starts),
    "loop": (f"{'plant':17} seed trials best  ratio  bound  rmse (of learn run)  rmse, of trial 0's", _loop),
    "photographs": (
        f"{'nozzle':>6} {'plant':14} {'seed':>4} {'material on ground':28} {'rms':>7} {'relative':>8} {'bias':>7}  "
        f"{'weighed':>7} {'relative':>8}",
        _photographs,
    ),
    "photo-session": (
        f"{'plant':17} seed trials best  ratio  bound  rmse, weighed, first only (exact)  "
        "widths' error, a photograph each",
        _photo_session,
    ),
}
"""A part's heading, and what makes a line of a cell."""


def show(cells: Sequence[Cell], rows: Sequence[Cell]) -> None:
    """Print the cells, and the targets with what stands beside them."""
    for part, (heading, line) in PARTS.items():
        mine = [cell for cell in cells if cell["part"] == part]
        if mine:
            print(heading)
        for cell in mine:
            print(line(cell))
        if mine:
            print()
    for row in rows:
        print(
            f"{'met   ' if row['met'] else 'MISSED'} {row['name']}: {row['value']:.4g} {row['unit']} ({row['target']})"
        )
        beside = {name: value for name, value in row.items() if name not in ("name", "value", "unit", "target", "met")}
        print(f"       {_said(beside)}")


def _said(found: Any) -> str:
    if isinstance(found, dict):
        return ", ".join(f"{name} {_said(value)}" for name, value in found.items())
    if isinstance(found, list):
        return "[" + ", ".join(_said(one) for one in found) + "]"
    return f"{found:.4g}" if isinstance(found, float) else str(found)
