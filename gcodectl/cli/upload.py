"""`gcodectl upload`: give a file to Moonraker or OctoPrint, which stream it by themselves."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gcodectl.cli.options import AsJson


def command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="G-code to upload.")],
    moonraker: Annotated[str, typer.Option(metavar="URL", help="Moonraker's address: http://printer.local:7125")] = "",
    octoprint: Annotated[str, typer.Option(metavar="URL", help="OctoPrint's address: http://octopi.local")] = "",
    api_key_file: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Holds the API key; else MOONRAKER_API_KEY, OCTOPRINT_API_KEY or GCODECTL_API_KEY."
        ),
    ] = None,
    start_print: Annotated[bool, typer.Option("--print", help="Print it as soon as it is there.")] = False,
    path: Annotated[str, typer.Option(metavar="FOLDER", help="Folder on the host to put it into.")] = "",
    as_json: AsJson = False,
) -> None:
    """Upload FILE to a host that streams it itself; Moonraker also checks its SHA-256.

    The API key comes from the environment or a file, never from the command line.
    Exit status 10 where nothing listens, 11 where it does not answer, 13 where it hangs up, 5 where it refuses.
    """
    import dataclasses
    import json
    import os
    import secrets
    import sys

    from gcodectl.errors import DeviceError, UsageError
    from gcodectl.link.api_key import find_key, warning
    from gcodectl.link.uploads import MOONRAKER, OCTOPRINT, upload

    if bool(moonraker) == bool(octoprint):
        raise UsageError("say where to: --moonraker URL or --octoprint URL, one of them")
    service = MOONRAKER if moonraker else OCTOPRINT
    key = find_key((service.key_variable,), api_key_file, os.environ)
    open_to_all = warning(api_key_file) if api_key_file else None
    if open_to_all:
        print(f"gcodectl: {open_to_all}", file=sys.stderr)
    done = upload(
        service, moonraker or octoprint, file, key=key, boundary=f"gcodectl-{secrets.token_hex(16)}",
        start_print=start_print, folder=path,
    )  # fmt: skip
    if as_json:
        typer.echo(json.dumps(dataclasses.asdict(done)))
    else:
        sum_said = f"SHA-256 {done.sha256[:16]}... {'checked there' if done.checked else 'not checked there'}"
        typer.echo(f"{done.path}: on {done.service} at {done.url}, {done.bytes} bytes, {sum_said}")
    if start_print and done.print_started is False:
        raise DeviceError(f"the file is there, but {done.service} did not begin to print it: is the printer ready?")
