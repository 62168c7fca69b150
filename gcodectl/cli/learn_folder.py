"""A session's folder: its files, written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gcodectl.config import Machine
    from gcodectl.session.record import Session, Trial

SHEET = "sheet.svg"


def gcode_of(path: Path, machine: Machine) -> str:
    """Return a file of G-code; InputError where it is none, or has a line that cannot be read."""
    from gcodectl.errors import InputError
    from gcodectl.pipeline import Options, read_moves

    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}", source=str(path)) from error
    for _ in read_moves([text.encode()], Options(machine, source=str(path))):
        continue
    return text


def keep(session: Session, folder: Path) -> None:
    """Write the G-code of trials and the sheet, and then the session."""
    from gcodectl.session.record import save

    complete(session, folder)
    save(session, folder)


def complete(session: Session, folder: Path) -> None:
    """Write the G-code of trials and the sheet where they are missing, or not the session's."""
    from gcodectl.cli.common import write_whole
    from gcodectl.session.photographs import sheet_of

    for one in session.trials:
        path = folder / one.file
        if path.exists() and one.prints:  # it is what was printed, whatever this version would write
            continue
        data = session.setup.printout.gcode(_title(session, one), one.u, session.setup.routine.dt)
        if not path.exists() or path.read_bytes() != data:
            write_whole(path, [data])
    sheet = folder / SHEET
    if not sheet.exists():
        write_whole(sheet, [sheet_of(session.setup.printout.layout, session.setup.nozzle).svg().encode()])


def _title(session: Session, trial: Trial) -> str:
    setup = session.setup
    layout = setup.printout.layout
    begin = layout.path[0]
    return (
        f"gcodectl learn: trial {trial.number} of {setup.material}, {setup.nozzle:g} mm nozzle\n"
        f"s = 0 mm and t = 0 s at X{begin[0]:.3f} Y{begin[1]:.3f}, {begin[0] - layout.datum[0, 0]:.3f} mm from the "
        f"datum's middle line\nthe path is {layout.length:.1f} mm long and takes {setup.routine.duration:.1f} s at "
        f"{layout.speed:.3f} mm/s, the nozzle {setup.printout.height:.3f} mm above the bed"
    )
