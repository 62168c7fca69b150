"""How a host goes about a job: the window, and how long it is patient. Seconds throughout."""

from __future__ import annotations

import dataclasses

from gcodectl.errors import UsageError

AUTO = 0


@dataclasses.dataclass(frozen=True)
class Settings:
    """What can be asked of a host; the defaults are safe on any Marlin."""

    window: int = 1
    """Commands that may be on their way at once; AUTO: as many as the printer's ADVANCED_OK says it has places for."""
    rx_bytes: int = 127
    """Bytes that may be on their way beyond the first command, which is being carried out: the receive buffer."""
    patience: float = 5.0
    """Without a sign of life for so long, an acknowledgement is asked after."""
    probes: int = 3
    """How often, before a printer that says `busy` when it is busy, or `wait` when it is not, is given up."""
    silence: float = 600.0
    """How long a printer that never says `busy` may be silent."""
    connect: float = 30.0
    """How long a printer may take to answer at first."""
    resends: int = 10
    """How often one line is sent again."""
    stop: float = 30.0
    """How long a printer that stops in good order may be silent."""
    reopen: float = 15.0
    """How long a port that went away is waited for, to make the printer safe."""
    report: float = 2.0
    """Between two reports of temperatures."""
    pull_back: float = 0.0
    """mm of E that release the plunger's pressure when a job is stopped."""

    resumed: bool = False
    """The job goes on where it broke off: a printer that was reset since has lost its place, and must not."""

    def __post_init__(self) -> None:
        if self.window < 0:
            raise UsageError(f"--window {self.window}: there are 1, 2, 3 ... and auto")
        if self.rx_bytes < 1:
            raise UsageError(f"--rx-bytes {self.rx_bytes}: it must be positive")
