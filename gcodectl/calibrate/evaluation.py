"""How good a guess is: every learner on what it has not seen, and which one is taken.

    leave one out             the other samples of the same session stay in: the next syringe of a known material
    leave one material out    all samples of a material go: a material that nobody has calibrated

    for each material H:  the others  --leave one of them out, again and again-->  which learner?  --guesses--> H
                                                        H itself had no part in it: nested

The simplest guess stands until another is better by more than what the materials scatter:

    mean  --better by 1 standard error-->  committee (the median of all learners)  --by 2-->  the best single learner

the error being that of the paired difference over materials. One step of 1 is the usual rule; a single learner must
show twice that, as it is the best of a dozen: among some ten materials that is mostly luck, and simply taken it was
worse than the mean. When learners are compared, every material counts the same.

Errors are of what is learned (`features`), a factor for what is a scale: exp |log guess - log true|.

Source: the rule of one standard error: Breiman et al., "Classification and Regression Trees", 1984; that a plain
combination is hard to beat: Clemen, "Combining forecasts", International Journal of Forecasting 5 (1989).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gcodectl.calibrate.calibration import Calibration
from gcodectl.calibrate.drives import by_drive
from gcodectl.calibrate.features import SHARES, make_features, targets
from gcodectl.calibrate.learners import COMMITTEE, NAMES, guesses
from gcodectl.columns import Floats
from gcodectl.errors import UsageError

BETTER, CLEARLY = 1.0, 2.0
"""Standard errors that the committee must be better by than the mean, and a single learner than what then stands."""
LEAST = 3
"""Materials that it takes to choose a learner; below, the mean is the guess."""
MEAN = "mean"
VARIES = 1e-3
"""What is the same within this everywhere needs no learner."""
CHOSEN = "chosen"
"""What a user gets: the learner chosen on the other materials."""


@dataclasses.dataclass(frozen=True)
class Known:
    """One parameter of the calibrations that know it: rows, and what is learned."""

    parameter: str
    calibrations: tuple[Calibration, ...]
    y: Floats

    @property
    def materials(self) -> tuple[str, ...]:
        """Each row's."""
        return tuple(one.material for one in self.calibrations)

    def without(self, away: Sequence[bool]) -> Known:
        """Return what is left when some rows go."""
        kept = [k for k, gone in enumerate(away) if not gone]
        return Known(self.parameter, tuple(self.calibrations[k] for k in kept), self.y[kept])

    def guess(self, others: Sequence[Calibration]) -> dict[str, Floats]:
        """Return every learner's guess for others, of what is learned."""
        features = make_features([one.attributes for one in self.calibrations])
        rows = features.of([one.attributes for one in self.calibrations])
        return guesses(rows, self.y, features.of([one.attributes for one in others]))


@dataclasses.dataclass(frozen=True)
class Errors:
    """One learner on one parameter: |error| of each sample, of what is learned."""

    parameter: str
    learner: str
    materials: tuple[str, ...]
    one_out: Floats
    material_out: Floats

    def with_more(self, other: Errors) -> Errors:
        """Return these errors and those of another kind of drive."""
        one_out, material_out = (np.concatenate(pair) for pair in
                                 ((self.one_out, other.one_out), (self.material_out, other.material_out)))  # fmt: skip
        return Errors(self.parameter, self.learner, (*self.materials, *other.materials), one_out, material_out)

    @property
    def is_factor(self) -> bool:
        """Whether the parameter is a scale."""
        return self.parameter not in SHARES

    def median(self, values: Floats) -> float:
        """Return the median over samples: a factor for a scale."""
        found = float(np.median(values))
        return float(np.exp(found)) if self.is_factor else found

    def over_materials(self, values: Floats) -> float:
        """Return the median over materials of their own medians: a factor for a scale."""
        return self.median(np.array([np.median(values[_of(self.materials, name)]) for name in set(self.materials)]))


def known_of(calibrations: Sequence[Calibration]) -> dict[str, Known]:
    """Return what can be learned of each parameter; calibrations that ended very early or late are left out."""
    good = [one for one in calibrations if one.attributes.good_enough]
    found = {}
    for name, y in targets(good).items():
        there = ~np.isnan(y)
        if there.any():
            found[name] = Known(
                name, tuple(one for one, is_there in zip(good, there, strict=True) if is_there), y[there]
            )
    return found


def material_out(known: Known) -> dict[str, Floats]:
    """Return every learner's |error| of each sample, guessed from the other materials."""
    return {name: np.abs(values) for name, values in misses(known).items()}


def misses(known: Known) -> dict[str, Floats]:
    """Return by how much every learner guesses each sample too low, from the other materials."""
    found = {name: np.empty(len(known.y)) for name in NAMES}
    for material in sorted(set(known.materials)):
        away = _of(known.materials, material)
        rows = [one for one, gone in zip(known.calibrations, away, strict=True) if gone]
        for name, values in known.without(list(away)).guess(rows).items():
            found[name][away] = known.y[away] - values
    return found


def choose(errors: dict[str, Floats], materials: Sequence[str]) -> str:
    """Return the learner to take, by its errors on materials it had not seen."""
    each = {name: np.array([values[_of(materials, one)].mean() for one in sorted(set(materials))])
            for name, values in errors.items()}  # fmt: skip
    best = min(each, key=lambda name: float(each[name].mean()))
    taken = COMMITTEE if _better(each[COMMITTEE], each[MEAN], BETTER) else MEAN
    return best if _better(each[best], each[taken], CLEARLY) else taken


def _better(one: Floats, other: Floats, errors: float) -> bool:
    """Return whether the errors of one, each material's, are lower by so many standard errors of their difference."""
    less = other - one
    return len(less) >= LEAST and bool(less.mean() > errors * less.std(ddof=1) / np.sqrt(len(less)))


def evaluate(calibrations: Sequence[Calibration]) -> list[Errors]:
    """Return the errors of every learner, and of the chosen one, on every parameter that differs anywhere.

    Each kind of drive by itself, as `suggest` guesses, and all of them together. Raises UsageError where no kind of
    drive has two materials.
    """
    kinds = by_drive(calibrations).values()
    if not any(len({one.material for one in kind}) > 1 for kind in kinds):
        raise UsageError("to leave one material out takes at least two materials; add calibrations of another one")
    found: dict[tuple[str, str], Errors] = {}
    for known in (known for kind in kinds for known in known_of(kind).values()):
        if len(set(known.materials)) > 1 and np.ptp(known.y) > VARIES:
            for one in _errors(known):
                before = found.get((one.parameter, one.learner))
                found[one.parameter, one.learner] = before.with_more(one) if before else one
    return list(found.values())


def _errors(known: Known) -> list[Errors]:
    outer = material_out(known)
    alone = {name: np.empty(len(known.y)) for name in NAMES}
    for k, one in enumerate(known.calibrations):
        others = known.without([j == k for j in range(len(known.y))])
        for name, values in others.guess([one]).items():
            alone[name][k] = abs(values[0] - known.y[k])
    nested = np.empty(len(known.y))
    for material in set(known.materials):
        away = _of(known.materials, material)
        rest = known.without(list(away))
        name = choose(material_out(rest), rest.materials) if len(set(rest.materials)) > 1 else MEAN
        nested[away] = outer[name][away]
    found = [Errors(known.parameter, name, known.materials, alone[name], outer[name]) for name in NAMES]
    taken = choose(outer, known.materials)
    return [*found, Errors(known.parameter, CHOSEN, known.materials, alone[taken], nested)]


def _of(materials: Sequence[str], name: str) -> NDArray[np.bool_]:
    return np.array([one == name for one in materials])
