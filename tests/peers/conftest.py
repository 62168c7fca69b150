"""The peers, installed once for all workers; what cannot be installed here is skipped with the reason."""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

from link_bench import peers as installed  # noqa: E402
from link_bench.octoprint_host import OctoPrint  # noqa: E402

INSTALL_S = 240


@pytest.fixture(scope="session")
def peers() -> None:
    """OctoPrint, Printrun, marlin-host and mecode in build/peers: made by one worker, the others wait."""
    build = ROOT / "build"
    build.mkdir(exist_ok=True)
    failed = build / f"peers-failed-{os.environ.get('PYTEST_XDIST_TESTRUNUID', os.getpid())}"
    with (build / "peers.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if failed.exists():
            pytest.skip(failed.read_text())
        reason = _install()
        if reason:
            failed.write_text(reason)
            pytest.skip(reason)


def _install() -> str:
    """Run tools/peers.sh; returns why it failed."""
    with subprocess.Popen(
        [str(ROOT / "tools" / "peers.sh")], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        start_new_session=True, env={**os.environ, "PYTHON": sys.executable},
    ) as process:  # fmt: skip
        try:
            said, _ = process.communicate(timeout=INSTALL_S)
        except subprocess.TimeoutExpired:
            installed.end(process)
            return f"the peers were not installed within {INSTALL_S} s"
    if process.returncode:
        return f"the peers cannot be installed here: {(said.strip().splitlines() or ['no reason given'])[-1]}"
    return ""


@pytest.fixture(scope="session")
def pronsole(peers: None) -> None:  # noqa: ARG001  installed before it is asked for
    """Debian's pronsole."""
    if "pronsole" in installed.missing():
        pytest.skip("Debian's pronsole is not here and cannot be installed")


@pytest.fixture(scope="session")
def octoprint(
    peers: None,  # noqa: ARG001  installed before it is started
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[OctoPrint]:
    """One OctoPrint server for all jobs; its ports are every `tty` in this run's folders."""
    folder = tmp_path_factory.mktemp("octoprint")
    with OctoPrint(folder, ports=[str(tmp_path_factory.getbasetemp() / "*" / "tty")]) as server:
        yield server


@pytest.fixture(scope="session")
def corpus() -> Path:
    """The folder of real G-code."""
    named = os.environ.get("GCODECTL_CORPUS", "")
    if not named or not Path(named).is_dir():
        pytest.skip("GCODECTL_CORPUS names no folder of G-code")
    return Path(named)
