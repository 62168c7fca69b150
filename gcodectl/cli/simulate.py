"""`gcodectl simulate`: print a file on the virtual machine and a model of the extruder, and score what was laid."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from gcodectl.records import TaskKind
    from plant_models.firmware import Execution
    from plant_models.printing import Bench
    from plant_models.score import Score


def command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The G-code to print.")],
    machine: Annotated[str, typer.Option(help="Machine profile: a name, or a .toml file.")],
    plant: Annotated[str, typer.Option(help="Extruder model: a name, or path/to/file.py:Attribute.")],
    target: Annotated[
        Path | None, typer.Option(metavar="ORIGINAL", help="The file whose roads are the target. Default: FILE itself.")
    ] = None,
    tool_plant: Annotated[
        list[str] | None, typer.Option(metavar="TOOL=PLANT", help="Another model for one tool; may be repeated.")
    ] = None,
    cap: Annotated[
        float | None, typer.Option(help="Cap the plunger at this many times the target's nominal flow.")
    ] = None,
    pressure_advance: Annotated[float, typer.Option(metavar="S", help="Klipper's pressure advance, s.")] = 0.0,
    smooth_time: Annotated[float, typer.Option(metavar="S", help="Its smoothing time, s.")] = 0.04,
    seed: Annotated[int, typer.Option(help="Seed of what is random in the model.")] = 0,
    pass_unknown: Annotated[
        bool, typer.Option("--pass-unknown", help="Take lines that cannot be understood as barriers.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as one JSON object.")] = False,
    plot: Annotated[Path | None, typer.Option(metavar="DIR", help="Write flow.png and part.png here.")] = None,
    material: Annotated[
        str | None, typer.Option(help="Mark the leads of this material's basis signals in flow.png.")
    ] = None,
    window: Annotated[
        str | None, typer.Option(metavar="FROM,TO", help="Seconds that flow.png shows. Default: the first 60.")
    ] = None,
) -> None:
    """Print FILE on a virtual machine and an extruder model, and score what was laid against ORIGINAL's roads."""
    from gcodectl.cli.compiling import announce_compiling
    from gcodectl.config import load_machine
    from plant_models.firmware import Firmware, execute
    from plant_models.gantry import cut
    from plant_models.printing import capped, nominal_flow, set_up
    from plant_models.reading import read_moves
    from plant_models.score import score

    announce_compiling()
    profile = load_machine(machine)
    others, shown = _tool_plants(tool_plant or []), _window(window)
    original = target or file
    wanted = moves = read_moves(original.read_bytes(), profile, source=str(original), pass_unknown=pass_unknown)
    flow = nominal_flow(cut(moves, profile, Firmware()))
    profile = capped(profile, flow, cap)
    bench = set_up(cut(moves, profile, Firmware()), profile, plant, tool_plants=others, seed=seed)
    if original != file:
        moves = read_moves(file.read_bytes(), profile, source=str(file), pass_unknown=pass_unknown)
    execution = execute([moves], profile, pressure_advance=pressure_advance, smooth_time=smooth_time)
    u, q = bench.printed(execution)
    result = score(bench.roads, execution, q)
    if plot is not None:
        from gcodectl.cli.pictures import write_pictures
        from gcodectl.cli.spans import find_spans

        spans = find_spans(wanted, profile, bench.roads, execution, _leads(material, profile.nozzle))
        written = write_pictures(plot, bench, execution, u, q, window=shown, tasks=spans)
        for path in written:
            typer.echo(f"wrote {path}", err=True)
    _show(result, bench, execution, {"file": str(file), "target": str(original), "plant": plant, "seed": seed}, as_json)


def _tool_plants(pairs: list[str]) -> dict[int, str]:
    """Read TOOL=PLANT pairs; UsageError where one is none."""
    from gcodectl.errors import UsageError

    plants: dict[int, str] = {}
    for pair in pairs:
        tool, equals, name = pair.partition("=")
        if not (equals and name and tool.removeprefix("T").isdigit()):
            raise UsageError(f"--tool-plant {pair}: write it as TOOL=PLANT, such as 1=paste-b")
        plants[int(tool.removeprefix("T"))] = name
    return plants


def _leads(material: str | None, nozzle: float) -> dict[TaskKind, float]:
    """Return the leads (s) of a material's basis signals; UsageError for one that no built-in library has."""
    from gcodectl.errors import UsageError
    from gcodectl.flow.library import builtin_libraries, load_library

    if material is None:
        return {}
    paths = builtin_libraries()
    if material not in paths:
        raise UsageError(f"there is no material {material!r}; there are {', '.join(paths)}")
    basis = load_library(paths[material]).find(material, nozzle)
    return {kind: signal.lead for kind, signal in basis.signals.items()}


def _window(text: str | None) -> tuple[float, float] | None:
    """Read FROM,TO; UsageError where it is no such thing."""
    from gcodectl.errors import UsageError

    if text is None:
        return None
    try:
        begin, end = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"--window {text}: write it as FROM,TO in seconds, such as 0,60") from None
    if not end > begin:
        raise UsageError(f"--window {text}: it ends before it begins")
    return begin, end


def _show(result: Score, bench: Bench, execution: Execution, about: dict[str, object], as_json: bool) -> None:
    """Print the score: one JSON object, or a few lines for people."""
    import json

    from plant_models.firmware import standing

    machine = bench.machine
    about |= {"machine": machine.name, "max_flow": machine.max_flow, "dt": bench.dt, "tail": bench.tail}
    if as_json:
        typer.echo(json.dumps({**about, **result.table(), "standing_s": standing(execution)}))
        return
    worst = f"{result.worst:+.0%} at X{result.worst_x:.1f} Y{result.worst_y:.1f} Z{result.worst_z:.2f}"
    rows = [
        ("rmse", f"{result.rmse:.4f}", f"bead error over {result.bins} bins on {result.roads} roads"),
        ("off_path", f"{result.off_path:.4f}", "volume beside the roads, a share of the target's"),
        ("time_s", f"{result.time_s:.1f}", f"of it {standing(execution):.1f} s standing"),
        ("bias", f"{result.bias:+.4f}", "mean error"),
        ("worst", worst, f"line {result.worst_line} of the target"),
        ("on_road", f"{result.on_road:.4f}", f"of the target volume, {result.target_volume:.0f} mm^3"),
    ]
    if result.unvisited > 1e-3:
        rows.append(("unvisited", f"{result.unvisited:.1%}", "of the target's roads"))
    for name, value, remark in rows:
        typer.echo(f"{name:10} {value:>12}   {remark}")
