"""Reproduce Hoelzle et al., "Iterative Learning Control Using a Basis Signal Library", on simulated plants.

Materials A and B of Table I are learned for 31 trials; the causal Q and a dead time are shown failing beside them; a
part of three lines (Fig. 9) and a tic-tac-toe part (Fig. 11) are built from the signals. Pictures go to a folder.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np

from gcodectl.config import Machine, load_machine
from gcodectl.flow.library import BasisSet
from gcodectl.learn.convergence import convergence
from gcodectl.learn.ilc import Law
from gcodectl.learn.model import Model, identify_by_step
from gcodectl.learn.reference import training_routine
from gcodectl.learn.segmentation import basis_set, find_segments
from gcodectl.learn.trials import Learner, Limits, Stop, run_trials
from gcodectl.pipeline import Options, compose_moves, filter_bytes, read_moves
from gcodectl.records import Composed, TaskKind
from gcodectl.report import basis, learning
from gcodectl.report.part import plot_part
from plant_models.bead import pieces
from plant_models.delay import DeadTime
from plant_models.gantry import Firmware, cut
from plant_models.parts import Style, fig9_gcode, tic_tac_toe_gcode
from plant_models.plant import Plant, load_plant
from plant_models.printing import set_up
from plant_models.reading import read_moves as read_printed
from plant_models.score import bin_errors
from plant_models.trial import as_trial

FLOW, SPEED, PAUSE, DT, TRIALS, DEAD = 5.0, 10.0, 0.2, 0.01, 31, 0.2
FIG9 = ["No-Flow", "Start", "Steady-State", "Corner", "Steady-State", "Corner", "Steady-State", "Stop", "No-Flow"]


def paper_machine() -> Machine:
    """Return a gantry that all but stops at corners, as the paper's does, and a plunger capped at 50 times the flow."""
    return dataclasses.replace(
        load_machine("syringe"), name="paper", accel=50.0, travel_accel=50.0, corner_speed=1.0,
        max_flow=50 * FLOW, max_flow_slew=5000 * FLOW,
    )  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Learned:
    """One learning run."""

    plant: str
    law: str
    learner: Learner

    @property
    def ratio(self) -> float:
        """Best RMS error over that of trial 0."""
        return self.learner.best.rms / self.learner.trials[0].rms

    def cell(self, case: str) -> dict[str, Any]:
        """As a cell of the bench."""
        learner = self.learner
        return {
            "case": case, "plant": self.plant, "law": self.law, "trials": len(learner.trials), "ratio": self.ratio,
            "best": learner.best.number, "stop": str(learner.stop), "notes": learner.notes,
            "peak_u": float(np.abs(learner.best.u).max()), "rms": [trial.rms for trial in learner.trials],
        }  # fmt: skip

    @property
    def run(self) -> learning.Run:
        """As a picture takes it."""
        learner, routine = self.learner, self.learner.routine
        return learning.Run(
            title=f"{self.plant}, {self.law}",
            t=routine.t,
            wanted=routine.q_ref,
            q=np.stack([trial.q for trial in learner.trials]),
            rms=np.array([trial.rms for trial in learner.trials]),
            u=learner.best.u,
            moments=(routine.start, routine.corner_middle, routine.stop),
        )


def learn(plant: Plant, name: str, law: str, model: Model, machine: Machine, lag: float, **options: Any) -> Learned:
    """Learn on a routine long enough for `lag`; its `pause` and what the Learner takes are options."""
    pause = options.pop("pause", PAUSE)
    routine = training_routine(FLOW, lag=lag, speed=SPEED, accel=machine.accel, pause=pause, dt=DT)
    rule = Law(dataclasses.replace(model, delay=0.0), DT, causal=law == "causal Q")
    learner = Learner(routine, rule, Limits(machine.max_flow, machine.max_flow_slew), max_trials=TRIALS, **options)
    list(run_trials(as_trial(plant), learner))
    return Learned(name, law, learner)


def all_runs(machine: Machine, seed: int) -> dict[str, list[Learned]]:
    """Learn A and B: for 31 trials, with a causal Q, until it stops on its own, behind a dead time, under the cap.

    The signals for the parts are learned without a pause: there the gantry turns its corners without waiting.
    """
    runs: dict[str, list[Learned]] = {}
    syringe = dataclasses.replace(machine, max_flow=load_machine("syringe").max_flow)
    plants = {name: load_plant(name, seed=seed) for name in ("paste-a", "paste-b")}
    models = {name: identify_by_step(as_trial(plant), FLOW, DT) for name, plant in plants.items()}
    lag = max(model.tau for model in models.values())
    for name, plant in plants.items():
        late = DeadTime(plant, DEAD)
        for case, on, law, profile, options in (
            ("full", plant, "zero-phase Q", machine, {"patience": TRIALS}),
            ("causal", plant, "causal Q", machine, {"patience": TRIALS}),
            ("own stop", plant, "zero-phase Q", machine, {}),
            ("dead", late, "dead time 0.2 s", machine, {"retry_with_delay": False}),
            ("retried", late, "dead time 0.2 s, then in the model", machine, {}),
            ("capped", plant, "plunger cap 5x", syringe, {}),
            ("parts", plant, "no pause, for the parts", machine, {"pause": 0.0}),
        ):
            runs.setdefault(case, []).append(learn(on, name, law, models[name], profile, lag, **options))
    return runs


def draw_learning(runs: dict[str, list[Learned]], folder: Path, seed: int) -> None:
    """Draw the paper's Figs. 3 to 6, and the convergence check."""
    note = f"linear plants paste-a (K 1.08, τ 2.7 s) and paste-b (K 0.89, τ 4.5 s), plunger cap 50x, seed {seed}"
    full, causal = [one.run for one in runs["full"]], [one.run for one in runs["causal"]]
    learning.plot_responses(full, (0, 15, 30), folder / "fig3_responses.png", note)
    learning.plot_errors(full, causal, folder / "fig4_errors.png", note)
    learning.plot_signals(full, folder / "fig5_signals.png", note)
    a = runs["full"][0].learner
    segments = find_segments(a.best.u, a.routine)
    pieces = segments.in_order(len(a.best.u))
    learning.plot_segments(full[0], pieces, segments.steady, folder / "fig6_segments.png", note)
    late = Model(a.law.model.K, a.law.model.tau, DEAD)
    curves = [
        learning.Curve(label, check.frequency, check.shrink, check.remains)
        for label, check in (
            ("nominal model", convergence(a.law)),
            ("plant with 0.2 s of dead time", convergence(a.law, late)),
            ("the same, delay in the law", convergence(a.law.with_delay(DEAD), late)),
            ("causal Q, nominal model", convergence(dataclasses.replace(a.law, causal=True))),
        )
    ]
    note = f"law: k_p 0.25, Q 3 Hz; plant paste-a (K 1.08, τ 2.7 s), seed {seed}"
    learning.plot_convergence(curves, folder / "convergence.png", note)


def composed(data: bytes, options: Options) -> Composed:
    """Return a part's moves, tasks and signal in one piece."""
    return basis.join(list(compose_moves(read_moves([data], options), options)))


def fig9(one: BasisSet, machine: Machine, plant: Plant, folder: Path | None, note: str) -> dict[str, Any]:
    """Build the part of Fig. 9: its sequence of tasks, its signal, and the flow's RMS error with and without."""
    data = fig9_gcode(Style.of(machine, FLOW))
    part = composed(data, Options(machine, (one,), sequencer="basis"))
    command = part.command
    wanted = command.reference / one.steady
    flows = [plant.run(plant.initial(), u, command.dt)[1] for u in (command.u, wanted)]
    if folder:
        basis.plot_sequence(command, flows[0], flows[1], part.tasks, one, folder / "fig10_sequence.png", note)
        basis.plot_tasks(part.moves, part.tasks, folder / "fig9_tasks.png", note)
        (folder / "fig9.gcode").write_bytes(data)
    basis_rms, none_rms = (float(np.sqrt(np.mean((flow - wanted) ** 2))) for flow in flows)
    sequence = [TaskKind(int(kind)).label for kind in part.tasks.kind]
    return {"part": "fig9", "sequence": sequence, "rms": basis_rms, "rms_none": none_rms}


def tic_tac_toe(
    one: BasisSet, machine: Machine, plant: str, seed: int, folder: Path | None, note: str
) -> list[dict[str, Any]]:
    """Build the tic-tac-toe part on the virtual printer, with both sequencers, and as it is; score it."""
    data = tic_tac_toe_gcode(Style.of(machine, FLOW))
    rows: list[dict[str, Any]] = []
    firmware = Firmware()
    bench = set_up(cut(read_printed(data, machine), machine, firmware), machine, plant, seed=seed, firmware=firmware)
    for name in ("none", "basis", "superpose"):
        options = Options(machine, (one,), sequencer=name)
        out = data if name == "none" else filter_bytes(data, options)
        execution = bench.run(cut(read_printed(out, machine), machine, firmware))
        score = bench.judge(execution)
        rows.append({"part": "tic-tac-toe", "with": name, **score.table()})
        if not folder:
            continue
        (folder / f"tic_tac_toe_{name}.gcode").write_bytes(out)
        errors, _, _ = bin_errors(bench.roads, execution, bench.printed(execution)[1])
        p0, p1, of_bin, layer = pieces(bench.roads)
        title = (
            f"tic-tac-toe, {name}: rmse {score.rmse:.3f}, off path {score.off_path:.3f}, {score.time_s:.1f} s ({note})"
        )
        plot_part(folder / f"fig11_{name}.png", p0, p1, errors[of_bin], layer, title=title)
    if folder:
        part = composed(data, Options(machine, (one,), sequencer="basis"))
        basis.plot_tasks(part.moves, part.tasks, folder / "fig12_tasks.png", note)
    return rows


def row(name: str, value: float, unit: str, target: str, met: bool) -> dict[str, Any]:
    """Return one target's row."""
    return {"name": name, "value": round(float(value), 4), "unit": unit, "target": target, "met": bool(met)}


def targets(runs: dict[str, list[Learned]], parts: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Hold what was measured against what the paper shows."""
    rows = []
    for full, causal, own, dead, again in zip(
        runs["full"], runs["causal"], runs["own stop"], runs["dead"], runs["retried"], strict=True
    ):
        name, share = full.plant, "of trial 0's RMS"
        rows.append(row(f"{name}: error within 31 trials", full.ratio, share, "<= 0.20", full.ratio <= 0.20))
        rows.append(row(f"{name}: the same, hoped for", full.ratio, share, "<= 0.15", full.ratio <= 0.15))
        rows.append(row(f"{name}: causal Q fails", causal.ratio, share, "> 0.20", causal.ratio > 0.20))
        worst = convergence(full.learner.law).worst
        rows.append(row(f"{name}: |Q(1 - LP)| beforehand", worst, "", "< 1", worst < 1))
        trials = len(own.learner.trials)
        rows.append(row(f"{name}: stops on its own", trials, "trials", "< 31", own.learner.stop is Stop.SETTLED))
        found = dead.learner.found.delay if dead.learner.found else 0.0
        safe = dead.learner.stop is Stop.DIVERGING and abs(found - DEAD) <= 0.2 * DEAD
        rows.append(row(f"{name}: dead time found, stopped safely", found, "s", "0.2 +- 20 %", safe))
        rows.append(row(f"{name}: learned with it in the model", again.ratio, share, "<= 0.20", again.ratio <= 0.20))
    for part in parts:
        if part["part"] == "fig9":
            rows.append(
                row("Fig. 9 sequence", len(part["sequence"]), "tasks", "as in the paper", part["sequence"] == FIG9)
            )
            share = part["rms"] / part["rms_none"]
            rows.append(row("Fig. 10: flow error with basis signals", share, "of none's RMS", "<= 0.5", share <= 0.5))
    scored = {part["with"]: part for part in parts if part["part"] == "tic-tac-toe"}
    for name in ("basis", "superpose") if scored else ():
        share = scored[name]["rmse"] / scored["none"]["rmse"]
        rows.append(row(f"tic-tac-toe: bead error, {name}", share, "of none's rmse", "<= 0.5", share <= 0.5))
    return rows


def main() -> None:
    """Run it all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="no pictures, no tic-tac-toe")
    parser.add_argument("--seed", type=int, default=0, help="seed of the plants' randomness (A and B have none)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("-o", "--output", type=Path, default=Path("build/basis"), help="folder for the pictures")
    arguments = parser.parse_args()
    folder = None if arguments.quick else arguments.output
    if folder:
        folder.mkdir(parents=True, exist_ok=True)
    machine, seed = paper_machine(), arguments.seed
    runs = all_runs(machine, seed)
    if folder:
        draw_learning(runs, folder, seed)
    a = runs["parts"][0].learner
    one = basis_set(a.best.u, a.routine, material="paste-a", nozzle=machine.nozzle, training={"plant": "paste-a"})
    note = f"linear plant paste-a (K 1.08, τ 2.7 s), machine paper: 50 mm/s², corners at 1 mm/s, cap 50x, seed {seed}"
    parts = [fig9(one, machine, load_plant("paste-a", seed=seed), folder, note)]
    if not arguments.quick:
        parts += tic_tac_toe(one, machine, "paste-a", seed, folder, "plant paste-a, seed " + str(seed))
    report(arguments, machine, runs, parts)


def report(
    arguments: argparse.Namespace, machine: Machine, runs: dict[str, list[Learned]], parts: list[dict[str, Any]]
) -> None:
    """Print the object, or the tables for people."""
    setting = {
        "bench": "reproduce_basis_signals", "quick": arguments.quick, "seed": arguments.seed, "flow": FLOW, "dt": DT,
        "trials": TRIALS, "speed": SPEED, "pause": PAUSE, "machine": dataclasses.asdict(machine),
    }  # fmt: skip
    learned = [one.cell(case) for case, several in runs.items() for one in several]
    rows = targets(runs, parts)
    if arguments.json:
        print(json.dumps({"setting": setting, "targets": rows, "cells": [*learned, *parts]}))
        return
    for cell in learned:
        said = f"{cell['trials']:3} trials  best {cell['ratio']:.3f} of trial 0  {cell['stop']}"
        print(f"{cell['plant']:8} {cell['law']:35} {said}")
    for part in parts[1:]:
        said = f"rmse {part['rmse']:.3f}  off path {part['off_path']:.3f}  {part['time_s']:.1f} s"
        print(f"{part['part']} {part['with']:10} {said}")
    print(f"Fig. 9: {{{', '.join(parts[0]['sequence'])}}}")
    for one in rows:
        verdict = "met   " if one["met"] else "MISSED"
        print(f"{verdict} {one['name']:42} {one['value']:8.3f} {one['unit']:17} {one['target']}")
    if not arguments.quick:
        print(f"pictures and G-code in {arguments.output}")


if __name__ == "__main__":
    main()
