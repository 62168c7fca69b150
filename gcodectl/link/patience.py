"""How long a host waits for an answer before it asks after it, and before it gives up.

    last sign of life     asked      asked      asked      given up
    --------|---------------|----------|----------|----------|------->      a printer that says `busy` while it is
            |  patience     | patience | patience | patience |

    --------|-------|-----------|-------------------|------- ... ----> silence     one that never does
            |       |  twice    |  four times       |

Source: Marlin, HOST_KEEPALIVE_FEATURE (M113): `busy` every 2 s while a command blocks.
"""

from __future__ import annotations

import math

from gcodectl.link.settings import Settings

LONG = 2.5
"""Times the printer's `busy` interval without which it is asked."""


class Patience:
    """When a silent printer is to be asked, and when to be given up. Seconds."""

    def __init__(self, settings: Settings, now: float) -> None:
        self.keepalive = 0.0
        """The interval of the printer's `busy`; 0: it never says so."""
        self.life = now
        """When the last sign of life came, or what waits now was sent."""
        self._settings = settings

    def ask_at(self, probes: int) -> float:
        """Return when it has been silent long enough to be asked, or given up, after so many questions."""
        wait = max(self._settings.patience, LONG * self.keepalive)
        if self.keepalive:
            return self.life + wait * (1 + probes)
        return min(self.life + wait * 2.0**probes, self.life + self._settings.silence)

    def over(self, probes: int, now: float) -> bool:
        """Whether it is to be given up rather than asked once more."""
        limit = self._settings.probes if self.keepalive else math.inf
        return probes >= limit or (not self.keepalive and now >= self.life + self._settings.silence)
