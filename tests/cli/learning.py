"""`gcodectl learn`, called as a person calls it."""

from __future__ import annotations

import typer
from typer.testing import CliRunner

from gcodectl.cli import learn

app = typer.Typer()
app.add_typer(learn.app, name="learn")


def call(*words, error=None):
    """Return what a command prints, or what the error that is expected says."""
    result = CliRunner().invoke(app, ["learn", *map(str, words)])
    if error is not None:
        assert isinstance(result.exception, error), result.exception
        return str(result.exception)
    if result.exception:
        raise result.exception
    return result.stdout
