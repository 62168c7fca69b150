"""Arguments and options that several commands have, once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

File = Annotated[str, typer.Argument(metavar="[FILE]", help="G-code to read; `-` is standard input.")]
MachineName = Annotated[str, typer.Option("--machine", "-m", help="Machine profile: a name, or a .toml file.")]
PassUnknown = Annotated[
    bool, typer.Option("--pass-unknown", help="Take lines that cannot be understood as barriers; the machine rests.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
Thermal = Annotated[
    Path | None, typer.Option("--thermal", metavar="PROFILE.toml", help="Heat profile: how the part cools.")
]


def group(purpose: str) -> typer.Typer:
    """Return a command that has commands of its own."""
    return typer.Typer(help=purpose, add_completion=False, no_args_is_help=True, rich_markup_mode=None)
