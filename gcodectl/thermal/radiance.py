"""What a camera reads, and what it is: a surface of emissivity e shows its own heat, and mirrors the rest of the room.

    reading^4 = e T^4 + (1 - e) T_env^4        T in K; a grey body seen over all wavelengths, by a camera set to e = 1

A real camera sees 7.5 to 13 um, where the exponent is nearer to 3.5 at these temperatures: a few degC at 250. A camera
that corrects for emissivity itself, as the paper's did, needs none of this. Source of e = 0.9 for CF/PC: section 4.1.2.
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import UsageError

KELVIN = 273.15


def corrected(reading: Floats, emissivity: float, ambient: float) -> Floats:
    """Return the temperature of what reads so, degC."""
    _check(emissivity)
    room = (1.0 - emissivity) * (ambient + KELVIN) ** 4
    own = (np.asarray(reading, dtype=np.float64) + KELVIN) ** 4 - room
    return np.asarray((np.maximum(own, 0.0) / emissivity) ** 0.25 - KELVIN)


def apparent(temperature: float, emissivity: float, ambient: float) -> float:
    """Return what a surface of that temperature reads, degC."""
    _check(emissivity)
    total = emissivity * (temperature + KELVIN) ** 4 + (1.0 - emissivity) * (ambient + KELVIN) ** 4
    return float(total**0.25 - KELVIN)


def _check(emissivity: float) -> None:
    if not 0.1 <= emissivity <= 1.0:
        raise UsageError(f"an emissivity lies between 0.1 and 1, not at {emissivity:g}; CF/PC has 0.9")
