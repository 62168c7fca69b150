"""Files filtered for Klipper, printed on the virtual one: nothing refused, the bead asked for, little time lost.

What its [extruder] allows when printer.cfg leaves it out is tight: a bead of four nozzles squared, E's speed stepping
by 1 mm/s at a junction, 330 mm/s^2 of E alone on a filament and 7.2 on a barrel of 15.8 mm.
"""

from __future__ import annotations

import dataclasses
import io

import pytest
from filtering import DATA, moves_of

from gcodectl.config import Machine, load_machine
from gcodectl.flow.library import open_library
from gcodectl.gcode.lines import read_chunks
from gcodectl.motion.feasible import Findings, Rule, inspect
from gcodectl.pipeline import Options, filter_bytes, read_moves, time_moves
from plant_models.firmware import Firmware, execute
from plant_models.gantry import cut
from plant_models.printing import set_up
from plant_models.score import Score

FILAMENT, SYRINGE = load_machine("filament-klipper"), load_machine("syringe-klipper")
ROADS = (
    "G21\nG90\nM83\nG1 X0 Y0 Z0.2 F3000\n"
    + "".join(f"G1 X{10 + 30 * (n % 2)} E1.1 F1800\nG1 Y{n + 1} F6000\nG4 P500\n" for n in range(8))
).encode()
"""Roads of 10 and 30 mm with half a second between them, the beads of the first thrice as thick."""
ASKED = 8 * 1.1 * FILAMENT.area
STAR = (DATA / "star_rel.gcode").read_bytes()


def bowden(machine: Machine = FILAMENT, sequencer: str = "model") -> Options:
    """The shipped signals and model of a bowden tube: a Start pushes many beads' worth at once."""
    return Options(machine, sets=(open_library().find("filament-bowden", 0.4),), sequencer=sequencer)


def judged(data: bytes, options: Options) -> Findings:
    timed = time_moves(read_moves(read_chunks(io.BytesIO(data)), options), options.machine)
    return Findings.concat([found for *_, found in inspect(timed, options.machine)])


def printed(data: bytes, target: bytes, machine: Machine, plant: str, flow: float) -> Score:
    """How well a file lays the target's roads on a plant made for `flow`, mm^3/s."""
    wanted, moves = (moves_of(text, Options(machine)) for text in (target, data))
    bench = set_up(cut(wanted, machine, Firmware()), machine, plant, flow=flow)
    return bench.judge(execute([moves], machine))


@pytest.mark.parametrize(
    ("sequencer", "rmse", "off_path", "volume", "late"),
    [("model", 0.10, 0.04, 0.04, 0.02), ("superpose", 0.30, 0.20, 0.04, 0.03)],
)
def test_a_bowden_tube_on_klipper(sequencer: str, rmse: float, off_path: float, volume: float, late: float) -> None:
    options = bowden(sequencer=sequencer)
    out = filter_bytes(ROADS, options)
    refused = (Rule.BEAD, Rule.LENGTH)
    assert not set(refused) & set(judged(out, options).rule.tolist())
    free = filter_bytes(ROADS, bowden(dataclasses.replace(FILAMENT, max_bead=1e6), sequencer))
    assert Rule.BEAD in judged(free, options).rule  # what Klipper would refuse, were it not eased
    moves = moves_of(out, options)
    assert float((moves.e * moves.area).sum()) == pytest.approx(ASKED, rel=volume)
    laid = printed(out, ROADS, FILAMENT, "melt-bowden", 8.0)
    as_sliced = printed(ROADS, ROADS, FILAMENT, "melt-bowden", 8.0)
    assert as_sliced.rmse > 0.4
    assert laid.rmse < rmse
    assert laid.off_path < off_path
    smooth = printed(out, ROADS, dataclasses.replace(FILAMENT, e_corner_speed=1e6), "melt-bowden", 8.0)
    assert laid.time_s < (1.0 + late) * smooth.time_s  # the junctions that it slows down at


def test_what_waits_between_roads_is_not_smeared_over_the_wait() -> None:
    """A Stop's end and the next Start's begin are short lines of E alone, and a G4 is left between them."""
    lines = filter_bytes(ROADS, bowden()).decode().splitlines()
    waits = [n for n, line in enumerate(lines) if line.startswith("G4 P")]
    between = [n for n in waits if lines[n - 1].startswith("G1 E-") and lines[n + 1].startswith("G1 E")]
    assert len(between) >= 6
    assert all(float(lines[n].removeprefix("G4 P")) > 50.0 for n in between)


def test_a_syringe_lays_the_same_bead_under_klipper_as_under_marlin() -> None:
    """Klipper takes lines of next to nothing whatever their bead: so a barrel fills while the head still crawls."""
    clay = open_library().find("clay", 0.84)
    scores = []
    for machine in (SYRINGE, load_machine("syringe")):
        options = Options(machine, sets=(clay,))
        out = filter_bytes(STAR, options)
        assert Rule.BEAD not in judged(out, options).rule
        scores.append(printed(out, STAR, machine, "syringe", 5.0))
    assert scores[0].rmse < 1.05 * scores[1].rmse
    assert scores[0].off_path < 1.2 * scores[1].off_path
    assert scores[0].time_s < 1.02 * scores[1].time_s
