"""Weights: what a scale shows, at which density, and whether it can be the weight of what was measured.

    unit        1000 times what was measured, or a thousandth, or a 28th        say in which unit that would be
    too much    more than 1.25 times: the sheet was weighed along               say what may lie on the scale
    too little  less than 0.8 times: a part of it, or dried                     say to weigh all of it, and at once
    held back   the extruder is too slow for its trials                         say which --lag to begin with
    coarse      fewer than ten of the scale's steps                             say which scale

A reading's last digit says what the scale reads. A photograph is off by 3 to 9 % of the volume, so that no weight less
sure than that is of use.
"""

from __future__ import annotations

import dataclasses
import math

from gcodectl.errors import UsageError
from gcodectl.session.checking import Fault
from gcodectl.session.record import Print, Session, Setup, Weight

PLAUSIBLE = 1.25
"""Times that a measurement may be off by, either way."""
MOST_HELD = 0.03
"""Share of a print that `beside` may be off by; a photograph is off by as much."""
UNSURE = 0.8
"""Readabilities that a weight is off by (rms): two readings, with and without the print, each rounded and repeated."""
FINE, COARSE = 100.0, 10.0
"""Readabilities that a print should weigh, and must, for it to say more than the measurement."""
DENSEST = 25.0
"""g/cm^3; nothing is denser."""
UNITS = {1000.0: "mg", 0.001: "kg", 1.0 / 28.35: "oz"}
"""By how much more than in g a weight is in other units."""


def read_weight(text: str) -> Weight:
    """Return a weight in g with all its digits, which say what the scale reads; UsageError where it is none."""
    plain = text.strip().replace(",", ".")
    try:
        grams = float(plain)
    except ValueError:
        grams = math.nan
    if not (math.isfinite(grams) and grams > 0):
        raise UsageError(f"--weighed is {text!r}; give grams as the scale shows them, as in 1.230")
    mantissa, _, exponent = plain.lower().partition("e")
    return Weight(grams, 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2])))


def with_density(session: Session, density: float | None, weights: int, anyway: bool = False) -> Session:
    """Return the session with the density that its weights are taken at, g/cm^3.

    Raises UsageError where there is none, or where it is another one, at which (not `anyway`) weights of before cannot
    be their prints'.
    """
    if density is None:
        if weights and not session.setup.density:
            raise UsageError("--weighed needs the density once, as laid: --density, in g/cm^3; water has 1.0")
        return session
    if not density > 0 or not math.isfinite(density):
        raise UsageError(f"--density is {density:g}; it must be a positive number, g/cm^3")
    if density > DENSEST:
        raise UsageError(f"--density is {density:g} g/cm^3, and nothing is so dense: 1050 kg/m^3 are 1.05 g/cm^3")
    told = dataclasses.replace(session, setup=dataclasses.replace(session.setup, density=density))
    before = [one for trial in session.trials for one in trial.prints if one.weight is not None]
    for one in before if not anyway else ():
        if not _amount_faults(session.setup, one) and (faults := _amount_faults(told.setup, one)):
            raise UsageError(
                f"--density was {session.setup.density:g} g/cm^3 so far; at {density:g}, {one.source} "
                f"{faults[0].sentence}. --anyway takes it as it is; the session is as it was"
            )
    return told


def weight_faults(setup: Setup, one: Print, lag: float) -> tuple[list[Fault], tuple[str, ...]]:
    """Return what is wrong with a print's weight beside its measurement, and notes on how much it says.

    `lag` (s) is the extruder's, as the measurement shows it.
    """
    assert one.weight is not None, "it was weighed"
    grams, step = one.weight.grams, one.weight.readability
    if faults := _amount_faults(setup, one):
        return faults, ()
    held = one.beside_sigma / (1.0 + one.beside)
    if held > MOST_HELD:
        return [Fault("weight", f"says little: the extruder lags by {lag:.1f} s, the trials were laid out for "
                      f"{setup.printout.lag:g} s, and by what it holds back the amount is sure to "
                      f"{100.0 * held:.1f} % only: leave --weighed out, or start again with --lag "
                      f"{2.0 * lag:.1f}")], ()  # fmt: skip
    finer = f"weigh with a scale that reads {10.0 ** math.floor(math.log10(grams / FINE)):g} g, and give all its digits"
    if grams < COARSE * step:
        return [Fault("weight", f"weighs {one.weight} on a scale that reads {step:g} g, which says less than the "
                      f"measurement: {finer}")], ()  # fmt: skip
    if grams < (1.0 - 1e-6) * FINE * step:
        return [], (f"weighs {one.weight} on a scale that reads {step:g} g, so the amount is sure to "
                    f"{100.0 * UNSURE * step / grams:.1f} % only: {finer}; or lay more (`learn start` with more "
                    "--flow or --lag)",)  # fmt: skip
    return [], ()


def _amount_faults(setup: Setup, one: Print) -> list[Fault]:
    """Return whether a print's weight is too far from the volume that was measured of it."""
    assert one.weight is not None, "it was weighed"
    seen = float(one.q.sum()) * setup.routine.dt * (1.0 + one.beside)
    ratio = 1000.0 * one.weight.grams / setup.density / seen if seen > 0 else math.inf
    said = f"weighs {one.weight}, {ratio:.3g} times what was measured of it at {setup.density:g} g/cm^3"
    for factor, unit in UNITS.items():
        if 0.4 < ratio / factor < 2.5:
            return [Fault("weight", f"{said}: it looks like {unit}; give --weighed in g")]
    if ratio > PLAUSIBLE:
        return [Fault("weight", f"{said}: see that nothing else lay on the scale (the sheet, what `begin` lays), to "
                      "the density, and to the measurement's unit")]  # fmt: skip
    if ratio < 1.0 / PLAUSIBLE:
        return [Fault("weight", f"{said}: weigh all that was laid, the datum too, and before it dries; see to the "
                      "density, and to the measurement's unit")]  # fmt: skip
    return []
