"""The hosts that were there first print whole files to our virtual printer: every line executed once, in order."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

import pytest
from link_bench.jobs import commands, without_own
from link_bench.octoprint_host import OctoPrint
from link_bench.ours import virtual_printer
from link_bench.peers import FINISHED, Outcome, run_marlin_host, run_mecode, run_printcore, run_pronsole

from gcodectl.errors import DeviceError
from gcodectl.link.uploads import OCTOPRINT, upload

LIMIT_S = 90.0
Run = Callable[[Path, Path, float], Outcome]


def prints(run: Run, file: Path, folder: Path, also: tuple[bytes, ...] = ()) -> None:
    """Have a peer print `file`, and compare what was executed with what the file asks for."""
    with virtual_printer(folder) as printer:
        outcome = run(printer.port, file, LIMIT_S)
    assert outcome.ended == FINISHED, outcome
    wanted = without_own(commands(file), also)
    executed = without_own(printer.executed(), also)
    wrong = next((k for k, (a, b) in enumerate(zip(executed, wanted, strict=False)) if a != b), None)
    assert wrong is None, f"command {wrong}: {executed[wrong]!r}, not {wanted[wrong]!r}"
    assert len(executed) == len(wanted) > 0


@pytest.mark.usefixtures("peers")
def test_printcore(corpus: Path, tmp_path: Path):
    prints(run_printcore, corpus / "cura_ender3_absE.gcode", tmp_path)


@pytest.mark.usefixtures("pronsole")
def test_pronsole(corpus: Path, tmp_path: Path):
    """Leaving, it switches off the heaters that the file left on."""
    prints(run_pronsole, corpus / "paste_cube_prusaslicer.gcode", tmp_path, also=(b"M104 S0.0", b"M140 S0.0"))


def test_octoprint(octoprint: OctoPrint, corpus: Path, tmp_path: Path):
    """Our own upload brings the file; `print` begins it."""
    prints(octoprint.run, corpus / "cura_ender3_absE.gcode", tmp_path)


@pytest.mark.usefixtures("peers")
def test_marlin_host(corpus: Path, tmp_path: Path):
    """It leaves comments in its numbered lines, which Marlin (and our printer) refuses; this file has none."""
    prints(run_marlin_host, corpus / "mecode_test.gcode", tmp_path)


@pytest.mark.usefixtures("peers")
def test_mecode(corpus: Path, tmp_path: Path):
    prints(run_mecode, corpus / "cncjs_jsdc.gcode", tmp_path)


def test_octoprint_takes_what_we_upload(octoprint: OctoPrint, tmp_path: Path):
    """A name with blanks, quotes and an umlaut; a folder that is not there yet; and what it refuses."""
    file = tmp_path / 'würfel "1".gcode'
    file.write_bytes(b"G28\nG1 X1 ; \xff\n")
    done = upload(OCTOPRINT, octoprint.url, file, key=octoprint.key, boundary="BOUNDARY", folder="clay/red")
    status, kept = octoprint.ask("GET", f"/api/files/local/{quote(done.path)}")
    assert (status, kept["size"]) == (200, file.stat().st_size)
    assert done.path.startswith("clay/red/")
    with pytest.raises(DeviceError, match="OCTOPRINT_API_KEY"):
        upload(OCTOPRINT, octoprint.url, file, key="wrong", boundary="BOUNDARY")
    other = tmp_path / "part.txt"
    other.write_text("G28\n")
    with pytest.raises(DeviceError, match=r"\.gcode"):
        upload(OCTOPRINT, octoprint.url, other, key=octoprint.key, boundary="BOUNDARY")
