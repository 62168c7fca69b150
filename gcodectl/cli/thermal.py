"""`gcodectl thermal`: from an infrared camera's frames to how a part cools, and to a plan of the next layer."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gcodectl.cli.options import AsJson, group

if TYPE_CHECKING:
    from gcodectl.thermal.road import Road
    from gcodectl.thermal.scene import Scene
    from gcodectl.thermal.surface import Band
    from gcodectl.thermal.track import Tracked

app = group("Heat of large parts: track frames of an infrared camera, fit a heat profile, plan layers, simulate.")

FramesPath = Annotated[
    Path, typer.Argument(metavar="FRAMES", help="A folder of 16-bit PNG or TIFF frames, one TIFF of pages, or NPZ.")
]
SceneFile = Annotated[
    Path, typer.Option("--scene", metavar="SCENE.toml", help="Path, bead and matching points: thermal example --scene.")
]
Base = Annotated[
    Path | None, typer.Option("--profile", metavar="PROFILE.toml", help="Heat profile with band, head and objective.")
]
Plot = Annotated[Path | None, typer.Option("--plot", metavar="FILE.png", help="Write a picture.")]


@app.command()
def example(
    scene: Annotated[bool, typer.Option("--scene", help="A scene, instead of a heat profile.")] = False,
) -> None:
    """Print a heat profile with its explanations, as `filter --thermal` reads it: copy it and put in your numbers."""
    from gcodectl.thermal import profile
    from gcodectl.thermal import scene as of_scene

    typer.echo((of_scene if scene else profile).EXAMPLE, nl=False)


@app.command()
def track(
    frames: FramesPath, scene: SceneFile, profile: Base = None, as_json: AsJson = False, plot: Plot = None
) -> None:
    """Find every layer that FRAMES show, and how each place along its road cools.

    Only the first layer needs matching points; the others are found by themselves. degC, s, mm, px.
    """
    import json

    layers, road, band = tracked(frames, scene, profile)
    rows = [_row(one, road, band, number) for number, one in enumerate(layers)]
    if plot is not None:
        from gcodectl.report.heat import plot_tracked

        plot_tracked(plot, layers[-1], road, band)
        typer.echo(f"gcodectl: wrote {plot}", err=True)
    if as_json:
        typer.echo(json.dumps({"frames": str(frames), "locations": len(road), "layers": rows}))
        return
    typer.echo(f"{frames}: {len(layers)} layers, {len(road)} locations along {road.s[-1]:.0f} mm")
    for row in rows:
        typer.echo(
            f"  layer {row['layer']}  laid {row['laid_from']:.0f} to {row['laid_to']:.0f} s, seen until "
            f"{row['until']:.0f} s at {row['coolest']:.1f} to {row['hottest']:.1f} degC; b0 {row['b0']:.4f}, "
            f"b1 {row['b1']:.6f}; moved {row['moved_px']:.1f} px; curves within {row['residual']:.2f} degC"
            + (f"; {row['unseen']} locations outside the frame" if row["unseen"] else "")
        )


@app.command()
def fit(
    frames: FramesPath,
    scene: SceneFile,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="PROFILE.toml", help="Write the profile here.")],
    profile: Base = None,
    as_json: AsJson = False,
) -> None:
    """Measure how a part cools from FRAMES, and write the heat profile that `filter --thermal` takes.

    Band, head and objective come from --profile, where one is given; without, they are those of CF/PC.
    """
    import json

    from gcodectl.cli.common import heat_profile, write_whole
    from gcodectl.thermal.fitted import fitted_profile
    from gcodectl.thermal.profile import profile_text

    layers, road, _ = tracked(frames, scene, profile)
    made = fitted_profile(layers, road, heat_profile(profile))
    comment = f"fitted to {len(layers)} layers of {frames.name}, {len(road)} locations"
    write_whole(output, [profile_text(made, comment).encode()])
    told = {
        "output": str(output), "layers": len(layers), "locations": len(road), "b0": made.b0, "b1": made.b1,
        "sigma": made.sigma, "deposition": made.band.deposition,
    }  # fmt: skip
    if as_json:
        typer.echo(json.dumps(told))
        return
    typer.echo(
        f"gcodectl: {frames}: {len(layers)} layers; on average b0 {made.b0:.4f} degC/s, b1 {made.b1:.6f} 1/s, laid at "
        f"{made.band.deposition:.0f} degC, predictions within {made.sigma:.2f} degC; wrote {output}", err=True,
    )  # fmt: skip


@app.command()
def plan(
    frames: FramesPath, scene: SceneFile, profile: Base = None, as_json: AsJson = False, plot: Plot = None
) -> None:
    """Plan the next layer on the one that FRAMES end with: when to begin it, and how fast to print each partition.

    Temperatures stay in the profile's band but for a share of alpha; where they cannot, the nearest plan is given, with
    the locations that leave the band and by how much. s counts on the clock of the frames; mm, mm/s, degC.
    """
    from gcodectl.cli.thermal_plan import plan_frames

    plan_frames(frames, scene, profile, plot, as_json=as_json)


@app.command()
def simulate(
    part: Annotated[str, typer.Argument(metavar="PART", help="A simulated part: wall, chassis, drifting.")] = "wall",
    layers: Annotated[int, typer.Option(min=1, max=200, help="Layers that are laid on the first.")] = 10,
    camera: Annotated[
        bool, typer.Option("--camera", help="See it through the simulated camera, head and all.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Seed of what is random in the part.")] = 0,
    as_json: AsJson = False,
    plot: Plot = None,
) -> None:
    """Print PART on its simulated surface, layer by layer: at the fixed time, as planned, and by one who knows it.

    The plan sees readings of the layers that lie there, and nothing else of the part; the first three are laid at the
    fixed time. Judged by the true temperatures beneath the roads.
    """
    from gcodectl.cli.thermal_simulate import simulate_part

    simulate_part(part, layers, seed, plot, through_camera=camera, as_json=as_json)


def tracked(frames: Path, scene: Path, profile: Path | None) -> tuple[list[Tracked], Road, Band]:
    """Track a recording; InputError where it shows no layer."""
    from gcodectl.cli.common import heat_profile
    from gcodectl.errors import InputError
    from gcodectl.thermal.frames import read_frames
    from gcodectl.thermal.scene import load_scene
    from gcodectl.thermal.surface import Band
    from gcodectl.thermal.track import track as find

    about: Scene = load_scene(scene)
    known = heat_profile(profile)
    band, road = known.band if known is not None else Band(), about.road()
    recording = read_frames(frames, scale=about.scale, offset=about.offset)
    layers = find(recording, road, about.perspective(), band, about.emissivity)
    if not layers:
        raise InputError(
            "no whole layer is laid in them: record from before a layer begins until it has cooled", source=str(frames)
        )
    return layers, road, band


def _row(one: Tracked, road: Road, band: Band, number: int) -> dict[str, Any]:
    """What is told of a layer."""
    import numpy as np

    last = one.surface.at(np.full(len(road), one.times[-1]), band.ambient)
    return {
        "layer": number, "laid_from": float(one.times[0]),
        "laid_to": float(one.times[one.laying.last - one.laying.first]), "until": float(one.times[-1]),
        "coolest": float(last.min()), "hottest": float(last.max()), "b0": float(one.surface.b0.mean()),
        "b1": float(one.surface.b1.mean()), "moved_px": float(one.registered.moved), "residual": one.residual,
        "unseen": one.unseen,
    }  # fmt: skip
