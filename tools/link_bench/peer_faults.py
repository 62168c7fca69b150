"""What a fault at line 150 makes of the hosts that were there first.

    for each peer and fault: virtual printer --faults FAULT@150 <-- peer prints 300 commands
                             how it ended (finished, hang, an error), after how long, and what was executed

exact: every command once and in order. A peer that says `finished` and is not exact has spoiled a part without a word.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from link_bench.jobs import commands, without_own, write_zigzag
from link_bench.octoprint_host import OctoPrint
from link_bench.ours import virtual_printer
from link_bench.peers import Outcome, run_marlin_host, run_mecode, run_octoprint, run_printcore, run_pronsole

LONG_LINE = "long-line"
"""Not the printer's fault: the job's line 150 is longer than the firmware takes."""
AT, COMMANDS = 150, 300
Run = Callable[[str | Path, Path, float], Outcome]
PEERS: dict[str, Run] = {
    "printcore": run_printcore,
    "pronsole": run_pronsole,
    "octoprint": run_octoprint,
    "marlin-host": run_marlin_host,
    "mecode": run_mecode,
}
LEAVING = (b"M104 S0.0", b"M140 S0.0")
"""What pronsole adds as it leaves."""


@dataclass(frozen=True)
class Row:
    """One peer and one fault."""

    peer: str
    fault: str
    ended: str
    seconds: float
    """The job alone where the peer tells, else the whole run."""
    missing: int
    """Commands of the job that were never executed."""
    repeated: int
    """Executions too many, of commands of the job."""
    foreign: int
    """Executions of what the job does not ask for."""
    exact: bool
    """Every command once, in order, and nothing else."""

    @property
    def verdict(self) -> str:
        """In a word or two, for a table."""
        if self.exact:
            return f"exact, {self.seconds:.1f} s" if self.ended == "finished" else f"{self.ended}, all was executed"
        return "wrong content" if self.ended == "finished" else self.ended


def strike(
    peer: str,
    fault: str,
    folder: Path,
    *,
    timeout: float,
    octoprint: OctoPrint | None = None,
    speed: str = "max",
    shift: int = 0,
) -> Row:
    """Have `peer` print to a printer with `fault` at line 150; `folder` must be empty.

    `octoprint`: a server that is running already, one of whose ports is `folder`/tty. `speed`: 1 where the fault takes
    time that the peer should feel (silence, busy, slow-ok). `shift`: by how much its numbers are higher than the lines.
    """
    job = folder / "job.gcode"
    write_zigzag(job, COMMANDS, AT if fault == LONG_LINE else 0)
    options = () if fault == LONG_LINE else ("--faults", f"{fault}@{AT + shift}")
    run = octoprint.run if peer == "octoprint" and octoprint else PEERS[peer]
    with virtual_printer(folder, *options, speed=speed) as printer:
        outcome = run(printer.port, job, timeout)
    seconds = outcome.seconds if outcome.printing_s is None else outcome.printing_s
    wanted, executed = without_own(commands(job), LEAVING), without_own(printer.executed(), LEAVING)
    asked, done = Counter(wanted), Counter(executed)
    return Row(
        peer, fault, outcome.ended, seconds,
        missing=(asked - done).total(),
        repeated=sum(done[one] - asked[one] for one in asked if done[one] > asked[one]),
        foreign=sum(count for one, count in done.items() if one not in asked),
        exact=wanted == executed,
    )  # fmt: skip
