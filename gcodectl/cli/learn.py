"""`gcodectl learn`: find basis signals by trials, on a machine or on a simulated plant."""

from __future__ import annotations

from gcodectl.cli.learn_finish import finish
from gcodectl.cli.learn_run import run
from gcodectl.cli.learn_session import drop, next_trial, start, status
from gcodectl.cli.learn_simulate import simulate
from gcodectl.cli.options import group

app = group("Learn basis signals by trials: on a machine with start, next and finish; on a simulated plant with run.")

for name, command in (
    ("start", start),
    ("next", next_trial),
    ("finish", finish),
    ("status", status),
    ("drop", drop),
    ("simulate", simulate),
    ("run", run),
):
    app.command(name)(command)
