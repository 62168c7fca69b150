"""What several commands share: finding machine and materials, opening input, writing output whole or not at all."""

from __future__ import annotations

import os
import stat
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from gcodectl.errors import InputError, UsageError

if TYPE_CHECKING:
    from gcodectl.config import Machine
    from gcodectl.flow.library import BasisSet
    from gcodectl.pipeline import Options
    from gcodectl.thermal.profile import HeatProfile

STDIN = "-"
FLAVORS = {"klipper": "klipper", "reprapfirmware": "reprapfirmware", "marlin": "marlin", "marlin2": "marlin"}


def machine_for(name: str, environment: Mapping[str, str]) -> Machine:
    """Load a machine profile; what a slicer says of itself in SLIC3R_* goes before what the profile says."""
    import dataclasses

    from gcodectl.config import load_machine

    machine = load_machine(name)
    changes: dict[str, float | str] = {}
    for variable, field in (
        ("SLIC3R_FILAMENT_DIAMETER", "barrel_diameter"),
        ("SLIC3R_NOZZLE_DIAMETER", "nozzle"),
    ):
        told = environment.get(variable, "").split(",")[0].strip()
        if told:
            try:
                changes[field] = float(told)
            except ValueError:
                raise UsageError(f"{variable} is {told!r}; the slicer should give a number of millimetres") from None
    flavor = FLAVORS.get(environment.get("SLIC3R_GCODE_FLAVOR", ""))
    if flavor:
        changes["dialect"] = flavor
    return dataclasses.replace(machine, **changes)  # type: ignore[arg-type]


def e_mode_told(environment: Mapping[str, str]) -> bool | None:
    """Whether the slicer says that it writes relative E; None where it says nothing."""
    told = environment.get("SLIC3R_USE_RELATIVE_E_DISTANCES", "").strip()
    return None if told not in ("0", "1") else told == "1"


def reading_options(file: str, machine: str, pass_unknown: bool, thermal: Path | None = None) -> Options:
    """Make the pipeline's options for a command that only reads."""
    from gcodectl.pipeline import Options

    return Options(
        machine=machine_for(machine, os.environ), pass_unknown=pass_unknown, relative_e=e_mode_told(os.environ),
        source=source_name(file), heat=heat_profile(thermal),
    )  # fmt: skip


def filter_options(
    file: str, machine: str, material: list[str], sequencer: str, quality: str, retracts: str, pass_unknown: bool,
    thermal: Path | None = None,
) -> Options:  # fmt: skip
    """Make the pipeline's options of the command line and of what the slicer says in the environment."""
    import typer

    from gcodectl.motion.follow import quality_named
    from gcodectl.pipeline import SEQUENCERS, Options

    if sequencer not in SEQUENCERS:
        raise UsageError(f"--sequencer {sequencer}: there are {', '.join(SEQUENCERS)}")
    if retracts not in ("replace", "keep"):
        raise UsageError(f"--retracts {retracts}: there are replace and keep")
    profile = machine_for(machine, os.environ)
    sets = material_sets(material, profile.nozzle)
    for one in sets:
        if one is not None and abs(one.nozzle - profile.nozzle) > 0.1 * profile.nozzle:
            typer.echo(
                f"gcodectl: {one.material} was learned with a nozzle of {one.nozzle:g} mm, and this one has "
                f"{profile.nozzle:g} mm: expect less of it, or learn it again", err=True,
            )  # fmt: skip
    return Options(
        machine=profile, sets=sets, sequencer=sequencer, quality=quality_named(quality),
        keep_retracts=retracts == "keep", pass_unknown=pass_unknown, relative_e=e_mode_told(os.environ),
        source=source_name(file), heat=heat_profile(thermal),
    )  # fmt: skip


def heat_profile(path: Path | None) -> HeatProfile | None:
    """Read a heat profile where one is given."""
    from gcodectl.thermal.profile import load_profile

    return load_profile(path) if path is not None else None


def source_name(file: str) -> str:
    """What messages call the input."""
    return "standard input" if file == STDIN else file


def material_sets(names: list[str], nozzle: float) -> tuple[BasisSet | None, ...]:
    """Find each tool's basis set: `neutral`, a built-in material, `file.npz`, or `file.npz:material`."""
    return tuple(_material(name, nozzle) for name in names)


def _material(name: str, nozzle: float) -> BasisSet | None:
    from gcodectl.flow.library import builtin_libraries, load_library

    if name == "neutral":
        return None
    builtin = builtin_libraries()
    if name in builtin:
        return load_library(builtin[name]).find(name, nozzle)
    path, _, material = name.rpartition(":") if ".npz:" in name else (name, "", "")
    if path.endswith(".npz"):
        library = load_library(Path(path))
        materials = sorted({one.material for one in library.sets})
        if not material and len(materials) != 1:
            raise UsageError(f"{path} holds {', '.join(materials)}: say which, as {path}:{materials[0]}")
        return library.find(material or materials[0], nozzle)
    raise UsageError(
        f"there is no material {name!r}; there are neutral, {', '.join(builtin)}, or a library as file.npz:material"
    )


@contextmanager
def open_input(path: str) -> Iterator[BinaryIO]:
    """Open a file, or standard input for `-`; InputError where there is none."""
    if path == STDIN:
        if sys.stdin is None:  # `<&-`, or a service without one
            raise InputError("is closed: name a FILE", source=source_name(STDIN))
        # unbuffered: a buffer that a thread waits in is locked, which Python cannot end with
        yield getattr(sys.stdin.buffer, "raw", sys.stdin.buffer)
        return
    try:
        file = Path(path).open("rb")  # noqa: SIM115  closed below; what fails while it is used is not its own fault
    except FileNotFoundError:
        raise InputError("there is no such file", source=path) from None
    except IsADirectoryError:
        raise InputError("is a folder, not a G-code file", source=path) from None
    except PermissionError:
        raise InputError("may not be read: check its permissions", source=path) from None
    with file:
        yield file


def write_stdout(chunks: Iterable[bytes]) -> int:
    """Write chunks to standard output as they come; returns how many bytes."""
    if sys.stdout is None:
        raise UsageError("standard output is closed: name a file with -o")
    written = 0
    for chunk in chunks:
        sys.stdout.buffer.write(chunk)
        sys.stdout.buffer.flush()
        written += len(chunk)
    return written


def write_whole(path: Path, chunks: Iterable[bytes]) -> int:
    """Write chunks to `path` so that it is there whole or as it was: a new file beside it takes its place at the end.

    Keeps the permissions of a file that is replaced; what is no regular file (a pipe, a device) is written directly.
    Returns how many bytes were written.
    """
    target = path.resolve() if path.is_symlink() else path
    if target.exists() and not target.is_file():
        with target.open("wb") as device:
            return sum(device.write(chunk) for chunk in chunks)
    if not target.parent.is_dir():
        raise UsageError(f"there is no folder {target.parent} to write {target.name} into; make it first")
    handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".tmp", dir=target.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            written = sum(file.write(chunk) for chunk in chunks)
            file.flush()
            os.fsync(file.fileno())
        mode = stat.S_IMODE(target.stat().st_mode) if target.exists() else 0o666 & ~_umask()
        Path(name).chmod(mode)
        Path(name).replace(target)
    except BaseException:
        with suppress(FileNotFoundError):
            Path(name).unlink()
        raise
    return written


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def duration(seconds: float) -> str:
    """Say a time as people do: 25 min 32 s."""
    hours, rest = divmod(round(seconds), 3600)
    minutes, left = divmod(rest, 60)
    return f"{hours} h {minutes} min" if hours else (f"{minutes} min {left} s" if minutes else f"{seconds:.1f} s")
