"""The commands of `gcodectl`, imported when they are called: to make all of them is a quarter of every start."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import typer
from typer.core import TyperGroup

COMMANDS = {
    "filter": "Lay learned flow signals over G-code: a file, or a pipe.",
    "check": "Read FILE as a printer would: what it does, and when.",
    "tasks": "Print the basis tasks of FILE in order.",
    "simulate": "Print FILE on a virtual machine and an extruder model.",
    "stream": "Send FILE to a printer, every line once and in order.",
    "upload": "Upload FILE to a host that streams it itself.",
    "virtual-printer": "Be a printer: answer hosts as Marlin does.",
    "learn": "Learn basis signals by trials.",
    "thermal": "Plan layers by the heat of the surface beneath.",
    "library": "List, show, export and import basis signals.",
    "calibrate": "Known calibrations, and a first guess for a new material.",
}
"""What `gcodectl --help` says of each; a command is the `command`, or the `app`, of the module of its name."""


class LazyGroup(TyperGroup):
    """Commands by name, each made when it is asked for."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Names, in the order of a job."""
        del ctx
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command, or None where there is none of that name."""
        del ctx
        if cmd_name not in COMMANDS:
            return None
        module = import_module(f"gcodectl.cli.{cmd_name.replace('-', '_')}")
        if hasattr(module, "app"):
            return typer.main.get_command(module.app)
        alone = typer.Typer(add_completion=False, rich_markup_mode=None)
        alone.command(cmd_name)(module.command)
        return typer.main.get_command(alone)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write what each does, without making any."""
        del ctx
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))
