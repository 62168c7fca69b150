"""Basis sets as text that other programs read: JSON, and Hoelzle's matrix (3) as CSV; either comes back as it was.

CSV, one block a set: a comment line with what does not fit a matrix, the tasks, then Lead, K and the samples.

    # gcodectl-library 1 {"material": "paste-a", "nozzle": 0.84, "dt": 0.01, "flow": 5.0, ...}
    row,Stop,Start,Corner,Steady-State,No-Flow
    lead,0.83,0.69,0.92,0.0,0.0
    K,163,141,173,1,1
    u(0),4.66,0.05,4.67,4.63,0.0
    ...
"""

from __future__ import annotations

import csv
import io
import json
from typing import Any

from gcodectl.errors import InputError
from gcodectl.flow.flow_model import FlowModel
from gcodectl.flow.library import DAMAGE, FORMAT, VERSION, BasisSet, BasisSignal, Library
from gcodectl.records import TaskKind

MARK = f"# {FORMAT} "
ABOUT = ("lead", "dip", "margin")
"""What a signal has beside its samples."""


def to_json(library: Library) -> str:
    """Return `library` as JSON text."""
    sets = [
        {
            **_about(one),
            "signals": {
                kind.label: {name: getattr(signal, name) for name in ABOUT} | {"values": signal.values.tolist()}
                for kind, signal in one.signals.items()
            },
        }
        for one in library.sets
    ]
    return json.dumps({"format": FORMAT, "version": VERSION, "sets": sets}, indent=1, allow_nan=False) + "\n"


def from_json(text: str, source: str = "") -> Library:
    """Read what `to_json` wrote; InputError where it is something else."""
    try:
        document = json.loads(text)
        _check(document.get("format"), document.get("version"), source)
        return Library(tuple(_set(one, one["signals"]) for one in document["sets"]))
    except DAMAGE as error:
        raise InputError(f"cannot be read as a library: {error}", source=source) from error


def to_csv(library: Library) -> str:
    """Return `library` as CSV text, a block a set."""
    out = io.StringIO()
    rows = csv.writer(out, lineterminator="\n")
    for one in library.sets:
        dips = {kind.label: signal.dip for kind, signal in one.signals.items()}
        margins = {kind.label: signal.margin for kind, signal in one.signals.items()}
        about = {**_about(one), "dips": dips, "margins": margins}
        out.write(f"{MARK}{VERSION} {json.dumps(about, allow_nan=False)}\n")
        rows.writerow(["row", *(kind.label for kind in TaskKind)])
        signals = [one.signals[kind] for kind in TaskKind]
        rows.writerow(["lead", *(signal.lead for signal in signals)])
        rows.writerow(["K", *(len(signal.values) for signal in signals)])
        for k in range(max(len(signal.values) for signal in signals)):
            samples = [float(signal.values[k]) if k < len(signal.values) else "" for signal in signals]
            rows.writerow([f"u({k})", *samples])
    return out.getvalue()


def from_csv(text: str, source: str = "") -> Library:
    """Read what `to_csv` wrote; InputError where it is something else."""
    try:
        blocks = text.split(MARK)
        if blocks[0].strip() or len(blocks) < 2:
            raise InputError("is not a gcodectl library", source=source)
        return Library(tuple(_block(block, source) for block in blocks[1:]))
    except DAMAGE as error:
        raise InputError(f"cannot be read as a library: {error}", source=source) from error


def _block(block: str, source: str) -> BasisSet:
    head, _, body = block.partition("\n")
    version, _, about = head.partition(" ")
    _check(FORMAT, int(version), source)
    document = json.loads(about)
    tasks, leads, lengths, *samples = list(csv.reader(io.StringIO(body)))
    signals = {
        label: {
            "lead": float(leads[column]),
            "dip": document["dips"][label],
            "margin": document["margins"][label],
            "values": [float(samples[k][column]) for k in range(int(lengths[column]))],
        }
        for column, label in enumerate(tasks)
        if column
    }
    return _set(document, signals)


def _about(one: BasisSet) -> dict[str, Any]:
    return {
        "material": one.material,
        "nozzle": one.nozzle,
        "dt": one.dt,
        "flow": one.flow,
        "training": dict(one.training),
        **({"model": one.model.table()} if one.model else {}),
    }


def _set(document: dict[str, Any], signals: dict[str, Any]) -> BasisSet:
    found = {
        kind: BasisSignal(
            signals[kind.label]["values"],
            lead=signals[kind.label]["lead"],
            dip=signals[kind.label]["dip"],
            margin=signals[kind.label]["margin"],
        )
        for kind in TaskKind
    }
    return BasisSet(
        document["material"], document["nozzle"], document["dt"], document["flow"], found,
        training=document["training"], model=FlowModel(**document["model"]) if "model" in document else None,
    )  # fmt: skip


def _check(form: object, version: object, source: str) -> None:
    if form != FORMAT:
        raise InputError("is not a gcodectl library", source=source)
    if not isinstance(version, int) or version > VERSION:
        raise InputError(
            f"is of version {version}; this gcodectl reads up to {VERSION}: please update it", source=source
        )
