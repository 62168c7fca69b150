"""From graded prints to the next setting: what was printed, and how its ends came out, says where ok lies.

        wanted setting x*: not known; before the first print as the guess for a new material says, and as it misses
                |
    print x --> grades  y = A (x* - x)   in road widths      very early | early | ok | late | very late
                |                                                      -3      -1    1      3
        settings that would not have given these grades weigh less      --> next: where ok at both ends is likeliest

Four knobs are turned: pushouttime p and acceldelay a for the road's start, pullbacktime b and deceldelay d for its
stop. What they do needs no learning. A plunger that sets off earlier by one second shifts the flow by that second,
v / w widths of road (speed v, width w); one that pushes longer by a second lays (P - R) / (w h) mm more near the
start (rates of pushout and road P, R, height h), and one that pulls longer B / (w h) less near the stop:

    the flow begins late by   v/w (a* - a)                                 the worse of these two is the grade of the
    the start lacks           v/w (a* - a) + (P - R)/(w^2 h) (p* - p)      start; of the stop likewise, with d, b, B

Where the operator tells place and amount apart (`start_place`, `start_amount`, ...), both are taken as they are.
What of that is wrong (a slow paste gives back its store later than the road's start is looked at) is taken for a
share OFF of what it says, and an older print counts for less than the last. A grade that nobody should have given
costs no setting more than MISTAKEN.

Source: Bayes' rule on weighted draws; the grades are those of Malone and Purwin's STARTERR and STOPERR.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.special import ndtr

from gcodectl.calibrate.calibration import GRADES, Attributes, Calibration, Parameters
from gcodectl.calibrate.features import decoded
from gcodectl.columns import Floats

KNOBS = ("pushouttime", "acceldelay", "pullbacktime", "deceldelay")
NEEDED = (*KNOBS, "pushoutspeed", "pullbackspeed", "inputspeed", "outputspeed")
BEGIN, END = 1.0, 3.0
"""Road widths: within the first an end is ok, within the second early or late, beyond very."""
OFF, READ = 0.3, 0.5
"""Standard deviation of a lateness: a share of it, and road widths (places are read off, thickness is not exact)."""
MISTAKEN = 0.001
FADES = 0.8
"""What a print counts for, once another one has been made: the rule is near, and nearer about the last setting."""
WIDER = 1.2
"""Times what guesses missed by among the known materials that a new one is taken to miss by."""
LEAST = (0.2, 0.1, 0.2, 0.1)
"""Standard deviations of what may be wanted, as it is learned, however alike the known materials are."""
ODD, FAR = 4, 3.0
"""One in ODD draws is FAR times as far: a material unlike all known ones must not be out of reach."""
LOWEST, HIGHEST = (-6.0, -5.0, -6.0, -5.0), (2.3, 5.0, 2.3, 5.0)
"""Bounds of a draw, as it is learned: no time over 10 s."""
DRAWS, CANDIDATES, JUDGES = 6000, 150, 600
SHORTEST = 0.002
"""s; of a pushout or pull-back that is tried."""
SAME = 0.02
"""Share within which two roads are one."""
_EDGES = np.array([-np.inf, -END, -BEGIN, BEGIN, END, np.inf])
_OK = GRADES.index("ok")


@dataclasses.dataclass(frozen=True)
class Wanted:
    """What setting a material may want: draws of the four knobs, s, and how likely each is; columns as in KNOBS."""

    knobs: Floats
    """[draw, knob]"""
    log_weight: Floats
    """[draw]"""

    @property
    def weight(self) -> Floats:
        """Of each draw; they sum to 1."""
        weight = np.exp(self.log_weight - self.log_weight.max())
        return np.asarray(weight / weight.sum(), dtype=np.float64)

    def after(self, one: Calibration) -> Wanted:
        """Return what is left when a print and its grades are known (see `is_graded`)."""
        each = grade_chances(lateness(self.knobs, one))
        told = one.attributes
        total = FADES * self.log_weight
        for place, apart, worse in (
            (0, (told.start_place, told.start_amount), told.start_error),
            (2, (told.stop_place, told.stop_amount), told.stop_error),
        ):
            if any(apart):
                chances = [each[:, place + k, GRADES.index(grade)] for k, grade in enumerate(apart) if grade]
            else:
                chances = [worse_of(each[:, place], each[:, place + 1])[:, GRADES.index(worse)]] if worse else []
            for chance in chances:
                total += np.log(MISTAKEN + (1.0 - MISTAKEN) * chance)
        return Wanted(self.knobs, total)

    def next_setting(self, one: Calibration, seed: int = 0) -> Floats:
        """Return the four knobs that are likeliest to be ok at both ends, rates and speed as in the last print."""
        rng = np.random.default_rng(seed)
        weight = self.weight
        middle = weight @ self.knobs
        near = 0.2 * np.sqrt(weight @ (self.knobs - middle) ** 2)
        tried = self.knobs[rng.choice(len(weight), CANDIDATES, p=weight)]
        tried = np.concatenate([tried, tried + near * rng.normal(size=tried.shape), [middle, setting(one)]])
        tried[:, [0, 2]] = np.maximum(tried[:, [0, 2]], SHORTEST)
        judges = self.knobs[rng.choice(len(weight), JUDGES, p=weight)]
        late = lateness(judges[None], one, tried[:, None])
        spread = np.hypot(READ, OFF * late)
        ok = np.prod(ndtr((BEGIN - late) / spread) - ndtr((-BEGIN - late) / spread), axis=-1).mean(axis=1)
        return np.asarray(tried[int(ok.argmax())], dtype=np.float64)

    def within(self, share: float) -> tuple[Floats, Floats]:
        """Return between what each knob lies with a chance of `share`."""
        ends = []
        for tail in ((1 - share) / 2, (1 + share) / 2):
            order = np.argsort(self.knobs, axis=0)
            gone = np.cumsum(self.weight[order], axis=0)
            place = [min(int(np.searchsorted(gone[:, k], tail)), len(order) - 1) for k in range(len(KNOBS))]
            ends.append(np.array([self.knobs[order[place[k], k], k] for k in range(len(KNOBS))]))
        return ends[0], ends[1]


def wanted_before(
    middle: Sequence[float], misses: Floats, materials: Sequence[str], attributes: Attributes, seed: int = 0
) -> Wanted:
    """Return what a material may want before its first print.

    `middle` is the guess of each knob as it is learned (`features.coded`), `misses` [knob, calibration] what such
    guesses missed by for the known ones, whose materials are named; every material weighs the same.
    """
    weight = np.array([1.0 / materials.count(one) for one in materials])
    spread = WIDER**2 * (misses * weight) @ misses.T / weight.sum()
    spread += np.diag(np.maximum(np.square(LEAST) - np.diag(spread), 0.0))
    drawn = np.random.default_rng(seed).multivariate_normal(np.zeros(len(KNOBS)), spread, DRAWS)
    drawn[::ODD] *= FAR
    drawn = np.clip(np.asarray(middle) + drawn, LOWEST, HIGHEST)
    rows = [decoded(dict(zip(KNOBS, row, strict=True)), attributes) for row in drawn.tolist()]
    return Wanted(np.array([setting(Calibration(attributes, row)) for row in rows]), np.zeros(DRAWS))


def setting(one: Calibration) -> Floats:
    """Return the four knobs of a calibration, s."""
    return np.array([getattr(one.parameters, name) for name in KNOBS], dtype=np.float64)


def lateness(wanted: Floats, one: Calibration, knobs: Floats | None = None) -> Floats:
    """Return how late [..., 4] a road begins, what its start lacks, how late it ends and what its stop has too much.

    In road widths, for wanted settings [..., 4] (KNOBS), on the print's road; `knobs` in place of what it was set to.
    """
    told = {name: float(getattr(one.parameters, name)) for name in NEEDED}
    width, height = float(one.attributes.path_width or 0.0), float(one.attributes.path_height or 0.0)
    less = wanted - (setting(one) if knobs is None else knobs)
    shifted = told["outputspeed"] / width * less[..., [1, 3]]
    bead = width * width * height
    pushed = max(told["pushoutspeed"] - told["inputspeed"], 0.1 * told["inputspeed"]) / bead * less[..., 0]
    pulled = told["pullbackspeed"] / bead * less[..., 2]
    return np.stack([shifted[..., 0], shifted[..., 0] + pushed, shifted[..., 1], shifted[..., 1] + pulled], axis=-1)


def grade_chances(late: Floats) -> Floats:
    """Return how likely each of GRADES is, [..., 4, grade], for lateness [..., 4] in road widths."""
    spread = np.hypot(READ, OFF * late)
    return np.asarray(np.diff(ndtr((_EDGES - late[..., None]) / spread[..., None]), axis=-1), dtype=np.float64)


def worse_of(place: Floats, amount: Floats) -> Floats:
    """Return how likely each of GRADES [draw, grade] is to be the worse of two, the place's where they tie."""
    worse = np.zeros_like(place)
    for i in range(len(GRADES)):
        for j in range(len(GRADES)):
            worse[:, i if abs(i - _OK) >= abs(j - _OK) else j] += place[:, i] * amount[:, j]
    return worse


def is_graded(one: Calibration) -> bool:
    """Whether a print tells its grades, its road and all that its lateness depends on."""
    graded = any(one.attributes.grades)
    road = one.attributes.path_width is not None and one.attributes.path_height is not None
    return graded and road and all(getattr(one.parameters, name) is not None for name in NEEDED)


def same_road(one: Calibration, attributes: Attributes) -> bool:
    """Whether a print is of the road that is asked for: its width, height and nozzle."""
    pairs = [
        (getattr(one.attributes, name), getattr(attributes, name))
        for name in ("path_width", "path_height", "nozzle_diameter")
    ]  # fmt: skip
    return all(a == b or (a is not None and b is not None and abs(a - b) <= SAME * b) for a, b in pairs)


def refined(wanted: Wanted, prints: Sequence[Calibration], seed: int = 0) -> tuple[Parameters, Wanted]:
    """Return the next setting after graded prints of one road, the last one's rates kept, and what is still wanted.

    A print that was ok at both ends is the setting; the last such one.
    """
    for one in prints:
        wanted = wanted.after(one)
    last = prints[-1]
    good = [one for one in prints if one.attributes.grades == ("ok", "ok")]
    if good:
        return good[-1].parameters, wanted
    values = wanted.next_setting(last, seed).tolist()
    return dataclasses.replace(last.parameters, **dict(zip(KNOBS, values, strict=True))), wanted
