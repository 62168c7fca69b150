"""A simulated operator: lays a road, looks at its ends, turns the knobs, until both ends are ok.

    print --> where does it begin and end, against the path?  --> acceldelay, deceldelay
              what does it lack, or have too much, near them? --> pushouttime, pullbacktime
              how thick is it in the middle?                  --> inputspeed

    begins (ends) where the flow first (last) passes half of what the road asks for; a place read off to +-0.3 mm
    lacks (has too much) within 15 mm of that end: as so many mm of the road
    of both: ok within a road's width; early, late within 3; very beyond, or nothing came out. The worse of both is the
    grade of that end (STARTERR, STOPERR)

The operator knows grades and thickness only, never the plant. Late: the plunger earlier, the pushout longer; early: the
reverse; times by 1.3, by 2 where it was very, delays by 0.1 and 0.3 s; what has been both is set to the middle of both.

Source: Malone and Purwin: grades, example values of table I, 11.9 prints by hand and 4 assisted (table III).
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod

import numpy as np

from gcodectl.calibrate.calibration import GRADES, Calibration, Parameters
from gcodectl.calibrate.profile import path_course, plunger_course
from gcodectl.columns import Floats
from learning_bench.materials import Material, Road
from plant_models.plant import Plant

PUSH = 20.0
"""mm^3/s; how fast a pushout and a pull-back go."""
BY_HAND = 0.4
"""s; pushout and pull-back of the paper's table I, from which a person begins who knows nothing better."""
ACCEL = 500.0
"""mm/s^2; of the path."""
SET_OFF, BRAKE = 0.5, 0.625
"""acceldelay and deceldelay of table I, as shares of the pushout and the pull-back."""
DT = 0.01
REST = 3.0
"""s before and after the road."""
LENGTH = 80.0
"""mm; of the road."""
OK, BAD = 1.0, 3.0
"""Road widths."""
NEAR = 15.0
"""mm of road at an end that are looked at for what it lacks or has too much."""
READ = 0.3
"""mm; standard deviation of a place that is read off."""
THICK = 0.1
"""Share of the thickness that is left as it is."""
MOST = 25
"""Prints before the operator gives up."""
SOMETHING = 0.05
"""Share of the road's volume that must lie on it before anybody says that it extrudes."""


@dataclasses.dataclass(frozen=True)
class Look:
    """What the operator sees of one print."""

    begins: str
    """Grades of the places, and of what is there too early (much) or too late (little); of the end, likewise."""
    lacks: str
    ends: str
    oozes: str
    thickness: float
    """In the middle, over what was asked for."""
    extrudes: bool

    @property
    def start(self) -> str:
        """STARTERR: the worse of both."""
        return max(self.begins, self.lacks, key=_severity)

    @property
    def stop(self) -> str:
        """STOPERR: the worse of both."""
        return max(self.ends, self.oozes, key=_severity)

    @property
    def good(self) -> bool:
        """OK at both ends."""
        return (self.start, self.stop) == ("ok", "ok")


@dataclasses.dataclass(frozen=True)
class Session:
    """One calibration: its prints, and where it ended."""

    looks: tuple[Look, ...]
    calibration: Calibration

    @property
    def iterations(self) -> int:
        """Prints until both ends were ok; one more than MOST where they never were."""
        return len(self.looks) if self.looks[-1].good else MOST + 1


def by_hand(road: Road) -> Parameters:
    """Return where a person begins who knows nothing better."""
    return set_up(road.speed, road.flow, (SET_OFF * BY_HAND, BY_HAND), (BRAKE * BY_HAND, BY_HAND))


def set_up(speed: float, rate: float, push: tuple[float, float], pull: tuple[float, float]) -> Parameters:
    """Return the twelve parameters of the knobs that are turned: path mm/s, plunger mm^3/s, delays and times s."""
    return Parameters(
        acceldelay=push[0], pushoutspeed=PUSH, pushouttime=push[1], inputspeed=rate,
        outputaccel=ACCEL, outputdecel=ACCEL, outputspeed=speed,
        deceldelay=pull[0], pullbackspeed=PUSH, pullbacktime=pull[1],
    )  # fmt: skip


def calibrate(material: Material, road: Road, begin: Parameters, rng: np.random.Generator) -> Session:
    """Print and turn knobs from `begin` on, until both ends are ok or MOST prints are made."""
    plant = material.plant()
    push = Delay(begin.acceldelay or 0.0), Time(begin.pushouttime or 0.0)
    pull = Delay(begin.deceldelay or 0.0), Time(begin.pullbacktime or 0.0)
    rate = begin.inputspeed or road.flow
    looks: list[Look] = []
    now = begin
    while True:
        look = look_at(plant, road, now, rng)
        looks.append(look)
        if look.good or len(looks) == MOST:
            attributes = dataclasses.replace(road.attributes(material), start_error=look.start, stop_error=look.stop)
            return Session(tuple(looks), Calibration(attributes, now, f"{len(looks)} prints"))
        if abs(look.thickness - 1.0) > THICK:
            rate *= float(np.clip(1.0 / max(look.thickness, 0.05), 0.5, 1.5))
        now = set_up(
            road.speed, rate, (push[0].turned(look.begins), push[1].turned(look.lacks)),
            (pull[0].turned(look.ends), pull[1].turned(look.oozes)),
        )  # fmt: skip


def look_at(plant: Plant, road: Road, parameters: Parameters, rng: np.random.Generator) -> Look:
    """Print a road and return what is seen of it."""
    return _look(*_print(plant, road, parameters), road, rng)


class Knob(ABC):
    """A number that is turned up when late, down when early, and to the middle once it has been both."""

    def __init__(self, value: float) -> None:
        self.value = value
        self._late, self._early = -math.inf, math.inf

    @abstractmethod
    def step(self, very: bool, up: bool) -> float:
        """Return the next value where it has not been both yet."""

    @abstractmethod
    def middle(self, low: float, high: float) -> float:
        """Return the middle of two values."""

    def turned(self, grade: str) -> float:
        """Return the next value."""
        if grade == "ok":
            return self.value
        late = grade.endswith("late")
        if late:
            self._late = self.value
        else:
            self._early = self.value
        if self._late >= self._early:  # it was misread, or another knob moved: begin to bracket again
            self._late, self._early = (self.value, math.inf) if late else (-math.inf, self.value)
        if math.isfinite(self._late) and math.isfinite(self._early):
            self.value = self.middle(self._late, self._early)
        else:
            self.value = self.step(grade.startswith("very"), late)
        return self.value


class Time(Knob):
    """A pushout or pull-back: by factors."""

    def __init__(self, value: float) -> None:
        super().__init__(max(value, 0.01))

    def step(self, very: bool, up: bool) -> float:
        """Return it longer or shorter."""
        factor = 2.0 if very else 1.3
        return float(np.clip(self.value * (factor if up else 1.0 / factor), 0.005, 10.0))

    def middle(self, low: float, high: float) -> float:
        """Return the geometric middle."""
        return math.sqrt(low * high)


class Delay(Knob):
    """How long the path waits for the plunger: by seconds."""

    def step(self, very: bool, up: bool) -> float:
        """Return it longer or shorter."""
        return self.value + (0.3 if very else 0.1) * (1.0 if up else -1.0)

    def middle(self, low: float, high: float) -> float:
        """Return the middle."""
        return (low + high) / 2


def _print(plant: Plant, road: Road, parameters: Parameters) -> tuple[Floats, Floats]:
    """Return the flow (mm^3/s) and where the head was from the path's beginning (mm), at each sample's middle."""
    ahead = max(parameters.acceldelay or 0.0, 0.0) + REST
    begin = math.ceil(ahead / DT) * DT
    end = begin + LENGTH / road.speed + road.speed / ACCEL
    edges = np.arange(round((end + REST) / DT) + 1, dtype=np.float64) * DT
    lane = (begin, end, 1.0)
    u = plunger_course(parameters, lane).means(edges)
    v = path_course(parameters, lane).means(edges)
    q = plant.run(plant.initial(), u, DT)[1]
    ramp = np.minimum(edges[:-1] + DT / 2 - begin, 0.0) + np.maximum(edges[:-1] + DT / 2 - end, 0.0)
    place = np.cumsum(v) * DT - v * DT / 2
    return np.asarray(q, dtype=np.float64), place + ramp * road.speed  # a head at rest: as far as it would have gone


def _look(q: Floats, place: Floats, road: Road, rng: np.random.Generator) -> Look:
    flowing = np.flatnonzero(q > road.flow / 2)
    on_road = (place > 0) & (place < LENGTH)
    middle = (place > 0.4 * LENGTH) & (place < 0.7 * LENGTH)
    thickness = float(q[middle].mean() / road.flow)
    extrudes = bool(q[on_road].mean() > SOMETHING * road.flow)
    seen = thickness * float(1.0 + 0.03 * rng.normal())
    if not len(flowing):
        return Look("very late", "very late", "ok", "ok", seen, extrudes)
    mm = q * DT / (road.width * road.height)  # of road that came out in each sample
    places = (
        float(place[flowing[0]]), NEAR - float(mm[place < NEAR].sum()),
        float(place[flowing[-1]]) - LENGTH, float(mm[place > LENGTH - NEAR].sum()) - NEAR,
    )  # fmt: skip
    begins, lacks, ends, oozes = (_grade(one + READ * rng.normal(), road.width) for one in places)
    return Look(begins, lacks, ends, oozes, seen, extrudes)


def _grade(late: float, width: float) -> str:
    if abs(late) <= OK * width:
        return "ok"
    return ("very " if abs(late) > BAD * width else "") + ("late" if late > 0 else "early")


def _severity(grade: str) -> int:
    return abs(GRADES.index(grade) - GRADES.index("ok"))
