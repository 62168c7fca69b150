"""Several photographs of one print: measured so that those without the datum road go by one that has it, and joined."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import InputError, UsageError
from gcodectl.vision.photo import Photo
from gcodectl.vision.sheet import Sheet
from gcodectl.vision.view import Scale
from gcodectl.vision.widths import Widths, measure_widths


def measure_session(
    images: Sequence[tuple[str, Photo]], path: Floats, datum: Floats, sheet: Sheet | Scale, step: float = 0.25, *,
    height: float = 0.0,
) -> Widths:  # fmt: skip
    """Return the widths from several photographs, (name, image) each, of one print and an unmoved sheet, joined.

    Those that do not show the datum road go by the shift of one that does. Raises InputError, named after the
    photograph, as `measure_widths` does.
    """
    if not images:
        raise UsageError("there is no photograph to measure")
    found: list[Widths] = []
    later: list[tuple[str, Photo]] = []
    refused: InputError | None = None
    for name, image in images:
        try:
            found.append(measure_widths(image, path, datum, sheet, step, height=height, name=name))
        except InputError as error:
            refused = refused or error
            later.append((name, image))
    if not found and refused:
        raise refused
    for name, image in later:
        found.append(measure_widths(image, path, datum, sheet, step, height=height, like=found[0], name=name))
    return join_widths(found)


def join_widths(several: Sequence[Widths]) -> Widths:
    """Return the widths of one print from several photographs: the mean of those that see a place, NaN where none does.

    Raises UsageError where they are of different paths or steps.
    """
    if not several:
        raise UsageError("there are no widths to join")
    first = several[0]
    if any(len(one.s) != len(first.s) or not np.allclose(one.s, first.s) for one in several):
        raise UsageError("the photographs were measured along different paths or at different steps")
    if len(several) == 1:
        return first
    each = np.stack([one.width for one in several])
    seen = np.isfinite(each)
    count = seen.sum(axis=0)
    mean = np.where(count > 0, np.where(seen, each, 0.0).sum(axis=0) / np.maximum(count, 1), np.nan)
    apart = (each - mean)[:, count > 1]
    notes = [note for one in several for note in one.notes]
    if apart.size and first.nominal > 0:
        rms = float(np.sqrt(np.nanmean(apart**2)))
        notes.append(
            f"{100 * (count > 1).mean():.0f} % of the strip is seen more than once, {100 * rms / first.nominal:.1f} % "
            "of the datum road's width (rms) from the mean"
        )
    known = [one.nominal for one in several if np.isfinite(one.nominal)]
    return Widths(
        first.s, mean, float(np.mean(known)) if known else float("nan"), first.shift,
        max(one.residual for one in several), np.full((len(first.s), 2, 2), np.nan), tuple(notes),
    )  # fmt: skip
