"""What is said of a session's weights: how to weigh, and what they correct, print by print and in all."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gcodectl.session.record import Print, Session, Trial
    from gcodectl.session.weighing import Correction


def how_to_weigh(session: Session, trial: Trial) -> str:
    """Return what a scale must read for a trial's print; nothing where the session does with the weights it has."""
    import math

    from gcodectl.session.weights import FINE

    if _weighs(session):
        return ""
    printout = session.setup.printout
    volume = printout.flow * printout.layout.datum_lasts + float(trial.u.sum()) * session.setup.routine.dt
    reads = 10.0 ** math.floor(math.log10(volume / 1000.0 / FINE))
    return (
        f"\nIt lays about {volume / 1000.0:.2g} cm^3. Weighed, all of it, with a scale that reads {reads:g} g, it pins "
        "the amount: --weighed GRAMS --density G_PER_CM3, of every print best, of one at least."
    )


def lines_of(session: Session) -> dict[int, list[str]]:
    """Return what each trial's prints are corrected by, as sentences; none of a session where nothing was weighed."""
    return {
        number: [_sentence(one, by) for one, by in prints if by is not None or _weighs(session)]
        for number, prints in _by_trial(session).items()
    }


def tables_of(session: Session) -> dict[int, list[dict[str, Any] | None]]:
    """Return the same as JSON values, a print each; None: as measured."""
    return {number: [_table(one, by) for one, by in prints] for number, prints in _by_trial(session).items()}


def amount(session: Session) -> list[str]:
    """Return sentences about how sure the amount is."""
    from gcodectl.session.weighing import told

    said = []
    for one in told(session):
        by = (
            f"a factor of {one['factor']:.3f}" if "factor" in one
            else f"{one['offset_mm']:+.3f} mm added to their widths"
        )  # fmt: skip
        said.append(
            f"weighed: {one['weighed']} of {one['corrected']} prints ({one['measured']}) at {one['density']:g} g/cm^3: "
            f"{by} in the mean, +- {one['standard_error']:.2g} a print; the amount is sure to "
            f"{100 * one['volume']:.1f} %, if the density is"
        )
    return said


def _by_trial(session: Session) -> dict[int, list[tuple[Print, Correction | None]]]:
    from gcodectl.session.weighing import corrections

    known = corrections(session)
    return {
        one.number: [(each, known.get((one.number, k))) for k, each in enumerate(one.prints)]
        for one in session.trials
    }  # fmt: skip


def _weighs(session: Session) -> bool:
    return any(one.weight is not None for trial in session.trials for one in trial.prints)


def _sentence(one: Print, by: Correction | None) -> str:
    from gcodectl.session.weighing import WIDTHS

    if by is None and one.way:
        return f"as measured: of prints that were measured so ({one.way}), none was weighed"
    if by is None:
        return "as measured: by a version that knew no weights; drop it and measure it again to have it corrected"
    changed = (
        f"widths {by.offset:+.3f} +- {by.sigma:.2g} mm" if one.way in WIDTHS
        else f"flow x {by.factor:.3f} +- {by.sigma:.2g}"
    )  # fmt: skip
    weight = "not weighed, as those that were" if one.weight is None else f"weighs {one.weight}"
    return f"{weight}: {changed}"


def _table(one: Print, by: Correction | None) -> dict[str, Any] | None:
    from gcodectl.session.weighing import WIDTHS

    if by is None:
        return None
    name, value = ("offset_mm", by.offset) if one.way in WIDTHS else ("factor", by.factor)
    grams = None if one.weight is None else one.weight.grams
    return {"grams": grams, name: value, "standard_error": by.sigma, "volume": by.volume, "own": by.own}
