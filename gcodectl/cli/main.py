"""`gcodectl`: the commands, one small file each, and how any of them ends.

Exit status: 0 fine, 1 our fault, 2 usage, 3 input, 4 refused as unsafe, 5 device (10 no
port, 11 no answer, 12 firmware, 13 disconnected); 130 after Ctrl-C.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from gcodectl.cli import check, filter, learn, library, simulate, stream, tasks, thermal, upload, virtual_printer
from gcodectl.errors import GcodectlError

app = typer.Typer(
    name="gcodectl",
    help="A slicer's G-code in, the same part with learned flow signals out.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for module in (filter, check, tasks, simulate, stream, upload):
    app.command(module.__name__.rpartition(".")[2])(module.command)
app.command("virtual-printer")(virtual_printer.command)
app.add_typer(learn.app, name="learn")
app.add_typer(library.app, name="library")
app.add_typer(thermal.app, name="thermal")


def _version(asked: bool) -> None:
    if asked:
        from gcodectl.version import VERSION

        typer.echo(f"gcodectl {VERSION}")
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    """Learned flow signals for paste, clay, silicone and pellet printers."""


CallError: type[Any] = next(one for one in typer.BadParameter.__mro__ if one.__name__ == "ClickException")
"""A call that cannot be read. Typer carries a click of its own in some versions: not always `click.ClickException`."""


def run() -> None:
    """Run the command line; every failure ends in one clear sentence on stderr and its exit status.

    Typer's own way to run would turn Ctrl-C and a closed pipe into statuses that we could not tell from others.
    """
    command = typer.main.get_command(app)
    if sys.stderr is None:  # closed: what would be said there must not go to standard output, where the G-code goes
        sys.stderr = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115  as long as the program
    try:
        with command.make_context("gcodectl", sys.argv[1:]) as context:
            command.invoke(context)
        if sys.stdout is not None:
            sys.stdout.flush()
    except typer.Exit as done:
        sys.exit(done.exit_code)
    except GcodectlError as error:
        _end(str(error), error.exit_status)
    except CallError as error:
        error.show()
        sys.exit(error.exit_code)
    except (KeyboardInterrupt, typer.Abort):
        _end("interrupted; nothing was left half written", 130)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as error:
        name = f" {error.filename}" if error.filename else ""
        _end(f"cannot go on{name}: {error.strerror or error}", 1)


def _end(message: str, status: int) -> None:
    print(f"gcodectl: {message}", file=sys.stderr)
    sys.exit(status)


if __name__ == "__main__":
    run()
