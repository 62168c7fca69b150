"""The learning bench's tables for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from learning_bench.guesses import STARTS
from learning_bench.starts import STARTS as BEGUN


def show(cells: Sequence[dict[str, Any]], rows: Sequence[dict[str, Any]]) -> None:
    """Print the cells, and the targets with what stands beside them."""
    real = [cell for cell in cells if cell["part"] == "fabathome"]
    if real:
        print(f"{'files':11} {'parameter':13} {'learner':16} {'one out':>8} {'material out':>13} {'a material':>11}")
    for cell in real:
        numbers = f"{cell['one_out']:8.3f} {cell['material_out']:13.3f} {cell['over_materials']:11.3f}"
        print(f"{cell['files']:11} {cell['parameter']:13} {cell['learner']:16} {numbers}")
    simulated = [cell for cell in cells if cell["part"] == "operator"]
    if simulated:
        print(f"\n{'material':14} {'plant':17} seed  prints, and the first one's ends, " + " | ".join(STARTS))
    for cell in simulated:
        told = " | ".join(f"{one['prints']:3} {one['start']}, {one['stop']}" for one in map(cell["starts"].get, STARTS))
        print(f"{cell['material']:14} {cell['plant']:17} {cell['seed']:4}  {told}")
    begun = [cell for cell in cells if cell["part"] == "starts"]
    if begun:
        print(f"\n{'material':14} {'plant':17} seed  trials and the first one's mm^3/s, {' | '.join(BEGUN)}")
    for cell in begun:
        told = " | ".join(f"{one['near']:3} {one['rms'][0]:6.3f}" for one in map(cell["starts"].get, BEGUN))
        print(f"{cell['material']:14} {cell['plant']:17} {cell['seed']:4}  {told}")
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
