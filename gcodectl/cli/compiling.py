"""The first run after installing: all kernels that reading and filtering need are compiled then, and never again.

A few lines are filtered for it, by this process and by a helper, which is this module, run: see kernels.crew.
"""

from __future__ import annotations

import sys

LINES = b"""G21
G90
M83
;LAYER_CHANGE
;TYPE:External perimeter
G1 X1 Y1 Z0.4 F6000
G1 X2 Y1 E0.004 F1200
G1 X2 Y2 E0.004
G2 X3 Y3 I1 J0 E0.006
G1 E-0.1 F1800
G1 X6 Y1 F6000
G1 E0.1 F1800
G1 X7 Y1 E0.004 F1200
G1 X7.1 Y1.05 E0.0004
G4 P10
"""
"""Lines that call for every kernel: roads with corners and an arc, a retract, a travel, a dwell."""


def announce_compiling() -> None:
    """Compile all kernels at once, and say so on stderr, if and when one is wanted that is not kept."""
    from gcodectl.jit import when_missing

    when_missing(_compile_all)


def _compile_all() -> None:
    from gcodectl.kernels.crew import compile_together
    from gcodectl.kernels.store import folder

    if folder() is None:
        _say(
            "compiling its kernels, a minute or so; they cannot be kept, as neither the program's folder nor the "
            "user's cache can be written: set NUMBA_CACHE_DIR to a folder that can"
        )
        return
    _say("compiling its kernels, about half a minute, this once")
    compile_together(run_all, __name__)


def run_all() -> None:
    """Call every kernel that check, tasks and filter call, in the order of the pipeline."""
    from gcodectl.cli.common import material_sets
    from gcodectl.config import load_machine
    from gcodectl.motion.feasible import inspect
    from gcodectl.pipeline import Options, filter_stream, find_tasks, read_moves, time_moves
    from gcodectl.report.survey import Survey

    machine = load_machine("syringe")
    plain = Options(machine)
    for moves, speeds, phases, _ in inspect(time_moves(read_moves([LINES], plain), machine), machine):
        Survey(machine).add(moves, speeds, phases)
    for _ in find_tasks(read_moves([LINES], plain), plain):
        pass
    for material, sequencer in (("neutral", "model"), ("clay", "superpose"), ("clay", "basis"), ("clay", "model")):
        sets = material_sets([material], machine.nozzle)
        for _ in filter_stream([LINES], Options(machine, sets, sequencer)):
            pass


def _say(words: str) -> None:
    print(f"gcodectl: {words}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    from gcodectl.kernels.crew import help_with

    help_with(run_all)
