"""The runner that the link bench compares with: it tells a hang, wrong content and a clean job apart, and in time."""

from __future__ import annotations

from pathlib import Path

import pytest
from link_bench.octoprint_host import OctoPrint
from link_bench.peer_faults import LONG_LINE, strike


@pytest.mark.usefixtures("peers")
def test_a_host_that_hangs_is_ended(tmp_path: Path):
    row = strike("printcore", "lost-ok", tmp_path, timeout=6)
    assert (row.ended, row.exact) == ("hang", False)
    assert row.missing > 100
    assert row.seconds < 60


@pytest.mark.usefixtures("peers")
def test_wrong_content_is_told_from_a_clean_job(tmp_path: Path):
    for fault in ("reset", "checksum"):
        (tmp_path / fault).mkdir()
    spoiled = strike("printcore", "reset", tmp_path / "reset", timeout=30)
    assert (spoiled.ended, spoiled.verdict) == ("finished", "wrong content")
    assert spoiled.repeated > 100
    clean = strike("printcore", "checksum", tmp_path / "checksum", timeout=30)
    assert (clean.exact, clean.missing, clean.repeated, clean.foreign) == (True, 0, 0, 0)


@pytest.mark.usefixtures("peers")
def test_a_hosts_own_error_is_told(tmp_path: Path):
    row = strike("marlin-host", LONG_LINE, tmp_path, timeout=40)
    assert "resend" in row.ended
    assert not row.exact


def test_octoprint_may_be_running_already(octoprint: OctoPrint, tmp_path: Path):
    row = strike("octoprint", "checksum", tmp_path, timeout=40, octoprint=octoprint)
    assert (row.ended, row.exact) == ("finished", True)
