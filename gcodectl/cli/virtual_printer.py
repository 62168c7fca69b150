"""`gcodectl virtual-printer`: a printer that needs no hardware, on a pty or a TCP port."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from gcodectl.config import Machine
    from plant_models.gantry import Firmware
    from plant_models.printer.live import Live
    from plant_models.printer.ports import TcpPort
    from plant_models.printer.pty_port import PtyPort
    from plant_models.printer.virtual import VirtualPrinter

Flag = typer.Option
LOOPBACK = "127.0.0.1"


def command(
    machine: Annotated[str, typer.Option(help="Machine profile: a name, or a .toml file.")],
    link: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Be a serial port: a pty, and a symbolic link to it here.")
    ] = None,
    tcp: Annotated[
        str | None, typer.Option(metavar="[HOST:]PORT", help="Be a TCP port; HOST is this machine alone if not given.")
    ] = None,
    speed: Annotated[str, typer.Option(metavar="1|N|max", help="Time passes N times as fast as it does.")] = "1",
    plant: Annotated[
        str | None, typer.Option(help="Extruder model that lays the bead: a name, or path/to/file.py:Attribute.")
    ] = None,
    target: Annotated[
        Path | None, typer.Option(metavar="ORIGINAL", help="The file whose roads are scored. Default: what is printed.")
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write executed lines, trajectory, bead and score here, at the end and on "
                     "M118 P0 SCORE."),
    ] = None,
    faults: Annotated[
        str, typer.Option(metavar="SPEC", help="name[=value]@line or %rate, comma-separated; `help` lists them.")
    ] = "",
    seed: Annotated[int, typer.Option(help="Seed of the faults, and of what is random in the model.")] = 0,
    once: Annotated[bool, typer.Option("--once", help="End when the first host has gone.")] = False,
    log: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write every line each way here, with times.")
    ] = None,
    junction: Annotated[
        str, typer.Option(help="Corners by `square` corner velocity (junction deviation) or classic `jerk`.")
    ] = "square",
    blocks: Annotated[int, typer.Option(metavar="N", help="BLOCK_BUFFER_SIZE.")] = 16,
    places: Annotated[int, typer.Option("--queue", metavar="N", help="BUFSIZE.")] = 4,
    longest: Annotated[int, typer.Option(metavar="N", help="Bytes kept of a line (MAX_CMD_SIZE - 1).")] = 95,
    rx_bytes: Annotated[
        int | None, typer.Option(metavar="N", help="Bytes kept while the queue is full; more are lost. Default: all.")
    ] = None,
    advanced_ok: Annotated[bool, Flag("--advanced-ok", help="ADVANCED_OK: ok N P B.")] = False,
    emergency_parser: Annotated[bool, Flag(help="EMERGENCY_PARSER: M108, M112, M410 act as they come.")] = True,
    ok_after_resend: Annotated[bool, Flag(help="`Resend: n` is followed by `ok`.")] = True,
    drop_repeats: Annotated[bool, Flag(help="The last lines, sent again, are dropped without an answer.")] = True,
    flush_on_error: Annotated[bool, Flag(help="An error throws away what has come and was not read.")] = True,
    greeting: Annotated[bool, Flag(help="Say `start` at boot.")] = True,
    wait: Annotated[float, typer.Option(metavar="S", help="Say `wait` this often when idle; 0: never.")] = 0.0,
    keepalive: Annotated[float, typer.Option(metavar="S", help="Say that it is busy this often; 0: never.")] = 2.0,
    extruders: Annotated[int, typer.Option(metavar="N", help="Tools that T knows.")] = 1,
    quoted_strings: Annotated[bool, Flag("--quoted-strings", help="; within quotes begins no comment.")] = False,
    paren_comments: Annotated[bool, Flag("--paren-comments", help="(...) is a comment.")] = False,
) -> None:  # fmt: skip
    """Be a printer: answer hosts as Marlin does, plan as a firmware does, and lay the bead on an extruder model."""
    from gcodectl.cli.compiling import announce_compiling
    from gcodectl.config import load_machine
    from gcodectl.link.dialect import Dialect
    from plant_models.gantry import Firmware
    from plant_models.printer.faults import parse_faults
    from plant_models.printer.live import Live
    from plant_models.printer.serve import Server
    from plant_models.printer.virtual import VirtualPrinter

    if faults == "help":
        _show_faults()
        return
    struck, rate, port = parse_faults(faults), _speed(speed), _port(link, tcp)
    profile, firmware = load_machine(machine), Firmware(junction=junction)
    dialect = Dialect(
        places=places, longest=longest, rx_bytes=rx_bytes, advanced_ok=advanced_ok, emergency_parser=emergency_parser,
        ok_after_resend=ok_after_resend, drop_repeats=drop_repeats, flush_on_error=flush_on_error, greeting=greeting,
        wait=wait, keepalive=keepalive, extruders=extruders, quoted_strings=quoted_strings,
        paren_comments=paren_comments,
    )  # fmt: skip
    _check_outcome(report, plant, target, seed)
    announce_compiling()
    _warm_up(profile, firmware)
    live = Live(profile, firmware, blocks=blocks)
    printer = VirtualPrinter(profile, dialect=dialect, faults=struck, seed=seed, motion=live)

    def outcome(printer: VirtualPrinter) -> str:
        return _outcome(printer, live, report, plant, target, seed, firmware)

    printer.on_score = outcome
    with _logging(log) as note:
        server = Server(printer, port, speed=rate, once=once, log=note)
        server.run(ready=lambda: typer.echo(f"a printer is at {port.name}", err=True))
    typer.echo(outcome(printer), err=True)


def _show_faults() -> None:
    from plant_models.printer.faults import KINDS

    for name, kind in KINDS.items():
        usual = "" if kind.value is None else f"={kind.value:g}"
        typer.echo(f"{name + usual:22} {kind.does}{'' if kind.survivable else '; the printer is dead'}")


def _speed(text: str) -> float:
    """Read 1, N or max; UsageError where it is none."""
    from gcodectl.errors import UsageError

    try:
        value = math.inf if text == "max" else float(text)
    except ValueError:
        value = math.nan
    if not value > 0:
        raise UsageError(f"--speed {text}: write max, or a number above 0")
    return value


def _port(link: Path | None, tcp: str | None) -> PtyPort | TcpPort:
    """Make the port asked for; UsageError where none or both are, or the address cannot be read."""
    from gcodectl.errors import UsageError
    from plant_models.printer.ports import TcpPort

    if link is not None and tcp is None:
        from plant_models.printer.pty_port import PtyPort

        return PtyPort(link)
    if tcp is None or link is not None:
        raise UsageError("say where to be found, with one of --link PATH and --tcp [HOST:]PORT")
    host, _, number = tcp.rpartition(":")
    if not number.isdigit() or int(number) > 65_535:
        raise UsageError(f"--tcp {tcp}: write [HOST:]PORT, such as 5000 or 0.0.0.0:5000; port 0: any that is free")
    return TcpPort(host.strip("[]") or LOOPBACK, int(number))


def _check_outcome(report: Path | None, plant: str | None, target: Path | None, seed: int) -> None:
    """Find out before the print, not after it, what could not be written; UsageError, InputError."""
    from gcodectl.cli.common import open_input
    from gcodectl.errors import UsageError
    from plant_models.drifted import load_drifted

    if plant is not None:
        if report is None:
            raise UsageError("--plant lays a bead that nobody would see: say where to write it, with --report DIR")
        load_drifted(plant, seed=seed)
    if target is not None:
        with open_input(str(target)):
            pass
    if report is not None:
        report.mkdir(parents=True, exist_ok=True)


def _warm_up(machine: Machine, firmware: Firmware) -> None:
    """Have the kernels compiled before a host waits for them."""
    from plant_models.printer.live import Live

    live = Live(machine, firmware)
    for k in range(1, 5):
        live.take(b"G1 X%d Y%d E%d F600" % (k, k % 2, k), 0.0)


def _outcome(
    printer: VirtualPrinter, live: Live, report: Path | None, plant: str | None, target: Path | None, seed: int,
    firmware: Firmware,
) -> str:  # fmt: skip
    """Write what is left of the print, and say it in one line."""
    from plant_models.printer.outcome import write_outcome

    said = f"{len(printer.executed)} commands executed"
    if report is None:
        return said
    executed = [(one.t, one.text) for one in printer.executed]
    score = write_outcome(
        report, live, executed, plant=plant, machine=printer.machine, target=target, seed=seed, firmware=firmware
    )
    if score is not None:
        said += f", rmse {score.rmse:.4f}, off_path {score.off_path:.4f}, time_s {score.time_s:.1f}"
    return f"{said}; see {report}"


@contextmanager
def _logging(path: Path | None) -> Iterator[Callable[[float, str, bytes], None] | None]:
    """Open the log; yields what notes bytes in it, None where there is no log."""
    if path is None:
        yield None
        return
    with path.open("w", encoding="ascii") as file:

        def note(t: float, way: str, data: bytes) -> None:
            for line in data.splitlines(keepends=True):
                text = line.decode("latin-1").encode("unicode_escape").decode("ascii")
                file.write(f"{t:.6f} {way} {text}\n")

        yield note
