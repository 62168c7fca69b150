"""The guess of one parameter: by the learner that serves best, moved by what is known of this very material.

    value   clipped to what was ever used; the material's own calibrations, where there are any, move it by what the
            guess from the others misses of them, the more of them the further
    range   what four in five guesses for materials that were left out are within, every material counting the same

Source: best linear unbiased prediction: Robinson, "That BLUP is a good thing", Statistical Science 6 (1991).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from gcodectl.calibrate.calibration import Attributes, Calibration, Parameters
from gcodectl.calibrate.evaluation import LEAST, MEAN, VARIES, Known, choose, misses
from gcodectl.columns import Floats

SHARE = 0.8
"""Of the guesses for unseen materials, that lie within the range."""


@dataclasses.dataclass(frozen=True)
class Guess:
    """The guess of one parameter, as it is learned."""

    value: float
    spread: float
    """Half its range; infinite where one material is all."""
    learner: str
    misses: Floats
    """How much too low such guesses were for the known ones, each from the other materials."""


def guess_one(known: Known, attributes: Attributes) -> Guess:
    """Return the guess of one parameter for `attributes`, with what is known of this very material."""
    name = Calibration(attributes, Parameters()).material
    mine = [one == name for one in known.materials]
    if not any(mine) or len(set(known.materials)) < LEAST:
        return _guess_new(known, attributes)
    others = known.without(mine)
    return _with_own(others, known, mine, _guess_new(others, attributes))


def _guess_new(known: Known, attributes: Attributes) -> Guess:
    """Return the guess for a material that is not among the known ones."""
    asked = [Calibration(attributes, Parameters())]
    materials = known.materials
    if len(set(materials)) == 1:
        return Guess(_guessed(known, asked, MEAN), math.inf, MEAN, np.zeros(len(known.y)))
    if np.ptp(known.y) < VARIES:
        return Guess(float(known.y.mean()), float(np.ptp(known.y)), MEAN, known.y - known.y.mean())
    off = misses(known)
    errors = {name: np.abs(values) for name, values in off.items()}
    taken = choose(errors, materials)
    return Guess(_guessed(known, asked, taken), _quantile(errors[taken], materials), taken, off[taken])


def _with_own(others: Known, known: Known, mine: Sequence[bool], guess: Guess) -> Guess:
    """Return a guess from the others, moved by what it misses of the material's own calibrations.

    What materials differ by, and what one of them scatters by, say how far (best linear unbiased prediction): n own
    ones count n D / (n D + S), D and S the variances between and within materials of what such guesses miss. What
    remains is the rest of D, and S again.
    """
    own = [one for one, is_mine in zip(known.calibrations, mine, strict=True) if is_mine]
    off = known.y[np.array(mine)] - others.guess(own)[guess.learner]
    groups = [guess.misses[np.array(others.materials) == name] for name in sorted(set(others.materials))]
    repeated = [group for group in groups if len(group) > 1]
    left = sum(len(group) - 1 for group in repeated)
    within = sum(float(((group - group.mean()) ** 2).sum()) for group in repeated) / left if left else 0.0
    between = max(float(np.mean([group.mean() ** 2 for group in groups])), VARIES**2)
    within = within or between
    share = len(off) * between / (len(off) * between + within)
    kept = math.sqrt(((1.0 - share) * between + within) / (between + within))
    spread = np.zeros(len(known.y))
    spread[~np.array(mine)] = kept * guess.misses
    return Guess(guess.value + share * float(off.mean()), kept * guess.spread, f"{guess.learner}, own", spread)


def _guessed(known: Known, asked: Sequence[Calibration], learner: str) -> float:
    return float(np.clip(known.guess(asked)[learner][0], known.y.min(), known.y.max()))


def _quantile(errors: Floats, materials: Sequence[str]) -> float:
    """Return what SHARE of the errors are within, every material weighing the same."""
    weight = np.array([1.0 / materials.count(one) for one in materials])
    order = np.argsort(errors)
    share = np.cumsum(weight[order]) / weight.sum()
    return float(errors[order][np.searchsorted(share, SHARE)])
