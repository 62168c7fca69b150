"""Suggestion: twelve parameters for a material that nobody has calibrated, how sure they are, and whom they come from.

    calibrations --same kind of drive?--> learners, this very material's own calibrations --> guess, range
                  `drives`: no: refused   `guess`

What no known calibration tells (Fab@Home's files have no accelerations) stays unknown, and is said. A guess is clipped
to what was ever used: no learner may ask for a pushout longer than any that was.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from pathlib import Path

from gcodectl.calibrate.calibration import PARAMETERS, Attributes, Calibration, Parameters
from gcodectl.calibrate.drives import same_drive
from gcodectl.calibrate.evaluation import known_of
from gcodectl.calibrate.features import SHARES, asked_flow, decoded, make_features
from gcodectl.calibrate.guess import guess_one
from gcodectl.calibrate.learners import distances
from gcodectl.errors import InputError, UsageError

NEIGHBOURS = 3


@dataclasses.dataclass(frozen=True)
class Suggestion:
    """A first guess, and what to think of it."""

    attributes: Attributes
    parameters: Parameters
    low: Parameters
    high: Parameters
    learners: dict[str, str]
    """Which one guessed each parameter."""
    nearest: tuple[tuple[str, float], ...]
    """Known materials and how far they are, nearest first, in ranges of the attributes."""
    notes: tuple[str, ...]


def suggest(calibrations: Sequence[Calibration], attributes: Attributes) -> Suggestion:
    """Return the first guess for `attributes`, made of the calibrations of the same kind of drive.

    Raises UsageError where nothing is known to guess from, UnsafeError where only another kind of drive is known.
    """
    kept, notes = same_drive(calibrations, attributes)
    known = known_of(kept)
    if not known:
        raise UsageError("the store is empty, or all in it began or ended very early or late: add calibrations first")
    guesses = {name: guess_one(one, attributes) for name, one in known.items()}
    guessed = {name: one.value for name, one in guesses.items()}
    low, high = ({name: one.value + sign * one.spread for name, one in guesses.items()} for sign in (-1, 1))
    parameters = decoded(guessed, attributes)
    return Suggestion(
        attributes, parameters, _ends(low, guessed, attributes), _ends(high, guessed, attributes),
        {name: one.learner for name, one in guesses.items()}, _nearest(kept, attributes),
        (*notes, *_notes(kept, attributes, parameters)),
    )  # fmt: skip


def load_guess(path: Path) -> tuple[Parameters, float]:
    """Return what `calibrate suggest -o` wrote: the parameters, and the flow that their road asks for, mm^3/s.

    Raises InputError where the file is none, or tells no road.
    """
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        attributes, parameters = Attributes(**told["attributes"]), Parameters(**told["parameters"])
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}", source=str(path)) from error
    except (ValueError, KeyError, TypeError, UsageError) as error:
        raise InputError(f"is no suggestion of `calibrate suggest -o`: {error}", source=str(path)) from error
    asked = asked_flow(attributes, parameters.outputspeed)
    if asked is None:
        raise InputError("suggests for no road: give path_width and path_height to `suggest`", source=str(path))
    return parameters, asked


def _ends(values: dict[str, float], middle: dict[str, float], attributes: Attributes) -> Parameters:
    """Return one end of every range: a share's with its time's own end, the rate's at the speed that is guessed."""
    ends = {}
    for name, value in values.items():
        beside = {
            **middle,
            name: value,
            **({SHARES[name]: values.get(SHARES[name], math.inf)} if name in SHARES else {}),
        }
        if not all(math.isfinite(one) for one in beside.values()):
            continue
        found = getattr(decoded(beside, attributes), name)
        if found is not None:
            ends[name] = found
    return Parameters(**ends)


def _nearest(calibrations: Sequence[Calibration], attributes: Attributes) -> tuple[tuple[str, float], ...]:
    known = [one.attributes for one in calibrations]
    features = make_features(known)
    far = distances(features.of(known), features.of([attributes]))[0]
    least: dict[str, float] = {}
    for one, how_far in zip(known, far, strict=True):
        least[one.material] = min(least.get(one.material, math.inf), float(how_far))
    return tuple(sorted(least.items(), key=lambda item: item[1])[:NEIGHBOURS])


def _notes(calibrations: Sequence[Calibration], attributes: Attributes, found: Parameters) -> list[str]:
    notes = []
    materials = {one.material for one in calibrations}
    ahead = _pushed_out(attributes, found)
    if ahead:
        notes.append(ahead)
    if len(materials) == 1:
        notes.append(f"{next(iter(materials))} is the only known material: no range can be told")
    if Calibration(attributes, found).material in materials:
        notes.append(f"{attributes.material} is known: its own calibrations move the guess, and narrow its range")
    missing = [name for name in PARAMETERS if getattr(found, name) is None]
    if missing:
        why = " (inputspeed needs path_width and path_height)" if "inputspeed" in missing else ""
        notes.append(f"no known calibration tells {', '.join(missing)}{why}")
    return notes


def _pushed_out(attributes: Attributes, found: Parameters) -> str:
    """Say what a pushout holds, as so much road: what is far from one's own syringe shows there."""
    asked = asked_flow(attributes, 1.0)
    if asked is None or found.pushoutspeed is None or found.pushouttime is None:
        return ""
    volume = found.pushoutspeed * found.pushouttime
    return f"the pushout is {volume:.3g} mm^3, as much as {volume / asked:.3g} mm of the road hold"


assert set(SHARES) < set(PARAMETERS)
