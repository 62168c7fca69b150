"""Weighing: what all that a print laid weighs says how far its measurement is off.

     photograph, calipers, sensor                       scale
       q along the path  ______                           |
       what lies beside  ______> volume as measured  =?=  weight / density
                                      ^
           one number, the same for the whole print, makes it so:
               widths               an offset  d:   w -> w + d m      shadows, dark flanks, where edges are seen
               areas and flows      a factor   k:   q -> k q          a sensor's scale, heights, the bed's

m = 1 for a road at least LOW times as wide as the nozzle is high, and in proportion to the width below: a thin bead is
low, and casts little shadow; without that, the tails of flow get longer than they are, and so does the lag learned.

What is not on the path: the datum and what oozes while the head rests behind it, and the run-out. Two fifths of a
print of paste are there, so it counts. The plunger's own volume does not tell it: K = weight / pushed holds where all
roads deliver the same share of what is pushed, but a yield stress, air pressure, or a slipping screw deliver less of
one road than of another (off by 9 % with air pressure, 2.6 % with a slow paste whose last road still oozes when the
print ends). So a flow model is fitted to what was measured of this very print, and run over all of it, from rest:

    u:  flow for the datum's time | 0 while it rests | the signal, which the measurement shows itself | 0 on the run-out
        \\______________ beside ______________/                                                         \\__ beside __/

    V = (1 + b) integral of q corrected,      b = what the model lays beside the path, over what was measured on it

b is a share, so a factor is no matter to it; an offset is, a little, and widths are corrected and fitted again (AGAIN
times). On simulated extruders that the routine is long enough for, measured exactly, that meets V to 0.0 to 1.1 %: best
melts and air pressure, worst pastes, whose barrel takes long to empty, so that their path does not tell their gain from
what they hold (HELD). An extruder that lags by far more than the session was begun for is off by 4 to 8 %, as much as a
photograph, and its weight is refused (`weights.MOST_HELD`).

What was measured is kept as it was, beside the weight, so that another density corrects it anew. Prints that were not
weighed get the mean of those that were and were measured the same way: shadows and flanks are the lamp's and the
material's, and add much the same to every photograph. What is another from print to print goes along with that, so
one weight in a session is better than none only where what all prints share is the larger part.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from scipy.optimize import brentq

from gcodectl.columns import Floats
from gcodectl.learn.fit import Record, choose
from gcodectl.session.checking import Fault
from gcodectl.session.measured import area_of, width_of
from gcodectl.session.record import Print, Session, Setup, Trial, Weight
from gcodectl.session.weights import UNSURE, weight_faults

WIDTHS = ("photo", "s,width")
"""Ways that are off by an offset of the width; all others are off by a factor."""
HELD = 0.25
"""Share of what the extruder holds in steady flow that may be missing beside the path (standard error)."""
LOW = 0.75
"""Heights of the nozzle; of roads that are thinner, a photograph is off by less (of 0 to 1.7 tried, 0.75 to 1 leave the
smallest error of thin roads)."""
LEAST = 1e-3
"""s of nominal flow: no print is taken to have laid less on its path."""
AGAIN = 2
"""Times that widths are corrected and the flow model fitted again."""


@dataclasses.dataclass(frozen=True)
class Correction:
    """What a print's measurement is corrected by."""

    factor: float = 1.0
    offset: float = 0.0
    """mm, added to its widths."""
    sigma: float = 0.0
    """Standard error of whichever it is."""
    volume: float = 0.0
    """Standard error of the amount, a share of it."""
    own: bool = True
    """From its own weight, not from other prints'."""


def with_weight(setup: Setup, u: Floats, one: Print, weight: Weight) -> tuple[Print, list[Fault], tuple[str, ...]]:
    """Return a print with its weight, what is wrong with that, and notes; u: its signal, samples of mm^3/s."""
    one, lag = laid_beside(setup, u, dataclasses.replace(one, weight=weight), one.q)
    faults, notes = weight_faults(setup, one, lag)
    for _ in range(AGAIN if one.way in WIDTHS and not faults else 0):
        one, _ = laid_beside(setup, u, one, corrected(setup, one.q, correction(setup, one)))
    return one, faults, notes


def laid_beside(setup: Setup, u: Floats, one: Print, q: Floats) -> tuple[Print, float]:
    """Return a print that knows what lies beside its path, and the extruder's lag at the nominal flow, s.

    u: its signal; q: what is believed to have flowed; both on the routine's samples, mm^3/s.
    """
    printout, dt = setup.printout, setup.routine.dt
    layout = printout.layout
    datum, rest, out = (round(one / dt) for one in (layout.datum_lasts, printout.rest, layout.run_out_lasts))
    model = choose([Record(u, q)], dt, setup.routine.flow)[0].model
    flow = model.predict(np.concatenate([np.full(datum, printout.flow), np.zeros(rest), u, np.zeros(out)]), dt)
    beside = float(flow.sum() - flow[datum + rest : datum + rest + len(u)].sum()) * dt
    held, on_path = float(model.stored(printout.flow)), max(float(q.sum()) * dt, LEAST * setup.routine.flow)
    return dataclasses.replace(one, beside=beside / on_path, beside_sigma=HELD * held / on_path), held / printout.flow


def correction(setup: Setup, one: Print) -> Correction:
    """Return what a weighed print is corrected by."""
    assert one.weight is not None, "it was weighed"
    dt = setup.routine.dt
    volume = 1000.0 * one.weight.grams / setup.density / (1.0 + one.beside)
    off = math.hypot(UNSURE * one.weight.readability / one.weight.grams, one.beside_sigma / (1.0 + one.beside))
    if one.way not in WIDTHS or not one.q.max() > 0:
        factor = volume / max(float(one.q.sum()) * dt, LEAST * setup.routine.flow)
        return Correction(factor, sigma=factor * off, volume=off)

    def laid(offset: float) -> float:
        return float(corrected(setup, one.q, Correction(offset=offset)).sum()) * dt

    high = max(_widest(setup, one.q), LOW * setup.printout.height)
    low = -high  # with which nothing is left
    while laid(high) < volume:
        high *= 2.0
    offset = float(brentq(lambda d: laid(d) - volume, low, high, xtol=1e-9))
    step = 1e-3 * setup.nozzle
    slope = (laid(offset + step) - laid(offset - step)) / (2.0 * step)
    return Correction(offset=offset, sigma=off * volume / slope, volume=off)


def corrections(session: Session) -> dict[tuple[int, int], Correction]:
    """Return the corrections of a session's prints, by the trial's number and the print's place in it."""
    prints = {(one.number, k): each for one in session.trials for k, each in enumerate(one.prints)}
    own = {at: correction(session.setup, one) for at, one in prints.items() if one.weight is not None}
    found = dict(own)
    for at, one in prints.items():
        like = [own[other] for other in own if prints[other].way == one.way and one.way]
        if at not in own and like:
            found[at] = _shared(like)
    return found


def counted(session: Session) -> tuple[Trial, ...]:
    """Return the measured trials as they count: their prints corrected by what was weighed."""
    known = corrections(session)
    if not known:
        return session.measured

    def as_weighed(number: int, k: int, one: Print) -> Print:
        by = known.get((number, k))
        return one if by is None else dataclasses.replace(one, q=corrected(session.setup, one.q, by))

    return tuple(
        dataclasses.replace(one, prints=tuple(as_weighed(one.number, k, each) for k, each in enumerate(one.prints)))
        for one in session.measured
    )


def told(session: Session) -> list[dict[str, Any]]:
    """Return what prints are corrected by, one table a way of measuring, as JSON values; none where none was weighed.

    offset_mm or factor: the mean over the prints that were weighed; standard_error: of one print's; volume: the
    standard error of the amount, a share of it.
    """
    known = corrections(session)
    ways: dict[str, list[Correction]] = {}
    for (number, k), one in known.items():
        ways.setdefault(session.trials[number].prints[k].way, []).append(one)
    tables = []
    for way, ones in ways.items():
        own = [one for one in ones if one.own]
        by = _shared(own)
        name, value = ("offset_mm", by.offset) if way in WIDTHS else ("factor", by.factor)
        tables.append({
            "measured": way, "weighed": len(own), "corrected": len(ones), "density": session.setup.density,
            name: round(value, 6), "standard_error": round(by.sigma, 6), "volume": round(by.volume, 6),
        })  # fmt: skip
    return tables


def corrected(setup: Setup, q: Floats, by: Correction) -> Floats:
    """Return flows along the path (mm^3/s) with a correction; where there is no road, there stays none."""
    if not by.offset:
        return by.factor * q
    speed, height = setup.printout.layout.speed, setup.printout.height
    return np.where(q > 0, area_of(shifted(width_of(q / speed, height), by.offset, height), height) * speed, q)


def shifted(width: Floats, offset: float, height: float) -> Floats:
    """Return widths of roads of a nozzle at `height`, mm, with an offset; less of it where a road is thin."""
    return np.maximum(width + offset * np.minimum(1.0, width / (LOW * height)), 0.0)


def _shared(weighed: list[Correction]) -> Correction:
    """Return the mean of corrections, for a print that was not weighed."""
    factors, offsets = np.array([one.factor for one in weighed]), np.array([one.offset for one in weighed])
    own = float(np.mean([one.sigma**2 for one in weighed]))
    spread = float(factors.var(ddof=1) + offsets.var(ddof=1)) if len(weighed) > 1 else 0.0
    share = max(one.volume for one in weighed)
    return Correction(float(factors.mean()), float(offsets.mean()), math.sqrt(own + spread), share, own=False)


def _widest(setup: Setup, q: Floats) -> float:
    return float(width_of(np.array([q.max()]) / setup.printout.layout.speed, setup.printout.height)[0])
