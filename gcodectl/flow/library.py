"""The basis signal library: for each material and nozzle, one learned plunger signal a basis task.

Hoelzle's matrix (3), kept task by task: Lead says how long before its task a signal begins, K how many samples it has,
and then come the samples. Stored as one `.npz` file with a JSON header: versioned, loads without pickle.

    header   {"format": "gcodectl-library", "version": 1, "sets": [{"material", "nozzle", "dt", ..., "model"}]}
    arrays   s<set>_<task>   the samples of one basis signal, mm^3/s
"""

from __future__ import annotations

import dataclasses
import io
import json
import math
import os
import zipfile
import zlib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Floats
from gcodectl.errors import InputError, UsageError
from gcodectl.flow.flow_model import FlowModel
from gcodectl.records import TaskKind

FORMAT = "gcodectl-library"
VERSION = 1
DAMAGE = (
    ValueError, KeyError, TypeError, AttributeError, EOFError, RuntimeError, MemoryError, zipfile.BadZipFile, zlib.error
)  # fmt: skip
"""What numpy, zipfile and json raise on a file that is damaged, or is something else altogether."""


@dataclasses.dataclass(frozen=True)
class BasisSignal:
    """The learned plunger rate of one task."""

    values: Floats
    """Samples, mm^3/s, at the nominal flow the set was learned at; K of them."""
    lead: float = 0.0
    """From the first sample to the task, s: the road's begin (Start), its end (Stop), the dip's middle (Corner)."""
    dip: float = 0.0
    """Corner only: seconds of nominal flow that the training routine's pause left out."""
    margin: float = 0.0
    """Start and Stop: seconds, counted in the lead, by which the flow is to reach beyond the road (`learn.margin`)."""

    def __post_init__(self) -> None:
        values = np.asarray(self.values, dtype=np.float64).copy()
        if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
            raise InputError("a basis signal must be a row of finite numbers")
        if not (math.isfinite(self.lead) and math.isfinite(self.dip) and self.dip >= 0):
            raise InputError("a basis signal's lead and dip must be finite numbers")
        values.flags.writeable = False
        object.__setattr__(self, "values", values)


@dataclasses.dataclass(frozen=True)
class BasisSet:
    """The five basis signals of one material in one nozzle, and what made them."""

    material: str
    nozzle: float
    """mm"""
    dt: float
    """Seconds a sample."""
    flow: float
    """Nominal flow rate of the training routine, mm^3/s; signals scale with the flow of the road they are used on."""
    signals: Mapping[TaskKind, BasisSignal]
    training: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    """Plant or machine, seed, trials, errors, limits, date, versions: JSON values only."""
    model: FlowModel | None = None
    """What predicts this extruder's flow, where the trials gave such a model."""

    def __post_init__(self) -> None:
        missing = [kind.label for kind in TaskKind if kind not in self.signals]
        if missing:
            raise InputError(f"the basis set {self.key} has no signal for {', '.join(missing)}")
        if not (self.dt > 0 and self.flow > 0 and self.nozzle > 0):
            raise InputError(f"the basis set {self.key}: dt, flow and nozzle must be positive")

    @property
    def key(self) -> str:
        """`material@nozzle`, what the set is listed by."""
        return f"{self.material}@{self.nozzle:g}"

    @property
    def steady(self) -> float:
        """Plunger rate a unit of flow asks for: the Steady-State mean over the nominal flow, 1 / K."""
        return float(self.signals[TaskKind.STEADY].values.mean()) / self.flow

    def matrix(self) -> Floats:
        """Matrix (3), shape (2 + longest K, 5): Lead, K, then the samples, a column a task; padded with NaN."""
        longest = max(len(signal.values) for signal in self.signals.values())
        matrix = np.full((2 + longest, len(TaskKind)), np.nan)
        for kind in TaskKind:
            signal = self.signals[kind]
            matrix[0, kind], matrix[1, kind] = signal.lead, len(signal.values)
            matrix[2 : 2 + len(signal.values), kind] = signal.values
        return matrix


@dataclasses.dataclass(frozen=True)
class Library:
    """Basis sets by material and nozzle."""

    sets: tuple[BasisSet, ...]

    def find(self, material: str, nozzle: float | None = None) -> BasisSet:
        """Return the set of `material` with the nozzle nearest to `nozzle`; UsageError for an unknown material."""
        found = [one for one in self.sets if one.material == material]
        if not found:
            raise UsageError(
                f"no material {material!r} in the library; it has {', '.join(one.key for one in self.sets)}"
            )
        return min(found, key=lambda one: abs(one.nozzle - (one.nozzle if nozzle is None else nozzle)))

    def add(self, one: BasisSet) -> Library:
        """Return the library with `one` in place of the set of the same material and nozzle, or after all others."""
        if any(other.key == one.key for other in self.sets):
            return Library(tuple(one if other.key == one.key else other for other in self.sets))
        return Library((*self.sets, one))


def save_library(library: Library, path: Path) -> None:
    """Write `library` to `path` as .npz with a JSON header; the same library gives the same bytes.

    The file appears whole or not at all: it is written beside its place and then moved there.
    """
    header = {
        "format": FORMAT,
        "version": VERSION,
        "sets": [
            {
                **{name: getattr(one, name) for name in ("material", "nozzle", "dt", "flow")},
                "leads": {kind.name: one.signals[kind].lead for kind in TaskKind},
                "dips": {kind.name: one.signals[kind].dip for kind in TaskKind},
                "margins": {kind.name: one.signals[kind].margin for kind in TaskKind},
                "training": dict(one.training),
                **({"model": one.model.table()} if one.model else {}),
            }
            for one in library.sets
        ],
    }
    arrays: dict[str, NDArray[Any]] = {
        f"s{number}_{kind.name}": one.signals[kind].values
        for number, one in enumerate(library.sets)
        for kind in TaskKind
    }
    arrays["header"] = np.frombuffer(json.dumps(header, sort_keys=True, allow_nan=False).encode(), dtype=np.uint8)
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with zipfile.ZipFile(beside, "w") as archive:
            for name, array in arrays.items():
                buffer = io.BytesIO()
                np.lib.format.write_array(buffer, array, allow_pickle=False)
                entry = zipfile.ZipInfo(f"{name}.npy", (1980, 1, 1, 0, 0, 0))
                archive.writestr(entry, buffer.getvalue(), compress_type=zipfile.ZIP_DEFLATED)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def load_library(path: Path) -> Library:
    """Read a library; InputError where the file is none, is damaged or is of a newer version."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            header = json.loads(archive["header"].tobytes()) if "header" in archive else {}
            if header.get("format") != FORMAT:
                raise InputError("is not a gcodectl library", source=str(path))
            if header.get("version", 0) > VERSION:
                raise InputError(
                    f"is of version {header['version']}; this gcodectl reads up to {VERSION}: please update it",
                    source=str(path),
                )
            return Library(tuple(_set(archive, number, entry) for number, entry in enumerate(header["sets"])))
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", source=str(path)) from error
    except DAMAGE as error:
        raise InputError(f"cannot be read as a library: {error}", source=str(path)) from error


def _set(archive: Mapping[str, NDArray[Any]], number: int, entry: dict[str, Any]) -> BasisSet:
    signals = {
        kind: BasisSignal(
            archive[f"s{number}_{kind.name}"],
            lead=entry["leads"][kind.name],
            dip=entry["dips"][kind.name],
            margin=entry["margins"][kind.name],
        )
        for kind in TaskKind
    }
    model = FlowModel(**entry["model"]) if "model" in entry else None
    return BasisSet(
        entry["material"], entry["nozzle"], entry["dt"], entry["flow"], signals, training=entry["training"], model=model
    )


def builtin_libraries() -> dict[str, Path]:
    """Built-in library files by material name."""
    folder = Path(str(resources.files("gcodectl") / "data" / "libraries"))
    return {path.stem: path for path in sorted(folder.glob("*.npz"))}


def open_library(path: Path | None = None) -> Library:
    """Return the library at `path`, or all built-in ones as one."""
    if path is not None:
        return load_library(path)
    return Library(tuple(one for built_in in builtin_libraries().values() for one in load_library(built_in).sets))
