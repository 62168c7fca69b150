"""An OctoPrint without a screen: a folder of its own, loopback only, no plugins that call out, driven by REST.

with OctoPrint(folder, ports=["/tmp/x/tty*"]) as octoprint:      some seconds to start
    octoprint.run(port, file, timeout)                           connect, upload, select and print, wait, disconnect
"""

from __future__ import annotations

import http.client
import json
import secrets
import socket
import subprocess
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from gcodectl.link.uploads import OCTOPRINT, upload
from link_bench.peers import FINISHED, HANG, PEERS, Outcome, end, environment

START_S = 60.0
POLL_S = 0.02
_OFF = (
    "achievements", "announcements", "appkeys", "backup", "corewizard", "discovery", "errortracking", "eventmanager",
    "file_check", "firmware_check", "gcodeviewer", "health_check", "pi_support", "pluginmanager", "softwareupdate",
    "tracking", "uploadmanager", "classicwebcam", "customcontrolmanager", "logging", "virtual_printer",
)  # fmt: skip


class OctoPrint:
    """One server, for as many jobs as there are."""

    def __init__(self, folder: Path, ports: list[str]) -> None:
        self._folder, self._key = folder, secrets.token_hex(16)
        with socket.create_server(("127.0.0.1", 0)) as free:
            self._port = int(free.getsockname()[1])
        config = {
            "accessControl": {"autologinLocal": False, "salt": "salt"},
            "api": {"key": self._key},
            "gcodeAnalysis": {"runAt": "never"},
            "plugins": {"_disabled": list(_OFF)},
            "serial": {"additionalPorts": ports, "autoconnect": False},
            "server": {
                "firstRun": False, "host": "127.0.0.1", "onlineCheck": {"enabled": False},
                "pluginBlacklist": {"enabled": False}, "pythonEolCheck": {"enabled": False}, "port": self._port,
            },
        }  # fmt: skip
        (folder / "config.yaml").write_text(json.dumps(config))  # JSON is YAML

    @property
    def url(self) -> str:
        """Where it listens."""
        return f"http://127.0.0.1:{self._port}"

    @property
    def key(self) -> str:
        """Its API key, made up for this run."""
        return self._key

    def __enter__(self) -> Self:
        folder = str(self._folder)
        self._process = subprocess.Popen(
            [PEERS / "bin" / "octoprint", "serve", "--iknowwhatimdoing", "--host", "127.0.0.1", "--port",
             str(self._port), "--basedir", folder],
            stdout=subprocess.DEVNULL, stderr=(self._folder / "stderr").open("w"), text=True, start_new_session=True,
            env=environment(folder), cwd=folder,
        )  # fmt: skip
        until = time.monotonic() + START_S
        while time.monotonic() < until and self._process.poll() is None:
            with suppress(OSError, http.client.HTTPException):  # an answering machine has the port while it starts
                if self.ask("GET", "/api/connection")[0] == 200:
                    return self
            time.sleep(0.1)
        end(self._process)
        said = (self._folder / "stderr").read_text().strip().splitlines()
        raise RuntimeError(f"OctoPrint did not start within {START_S:g} s: {said[-1:] or 'it says nothing'}")

    def __exit__(self, *_: object) -> None:
        end(self._process)

    def ask(self, method: str, path: str, body: object = None) -> tuple[int, Any]:
        """Make one request; returns the status and what the answer's JSON says."""
        line = http.client.HTTPConnection("127.0.0.1", self._port, timeout=30)
        try:
            headers = {"X-Api-Key": self._key, "Content-Type": "application/json"}
            line.request(method, path, json.dumps(body) if body is not None else None, headers)
            answer = line.getresponse()
            text = answer.read()
            return answer.status, json.loads(text) if text and answer.status == 200 else None
        finally:
            line.close()

    def run(self, port: str | Path, file: Path, timeout: float) -> Outcome:
        """Print `file` to `port`, which must match one of `ports`."""
        begun = time.monotonic()
        until = begun + timeout
        command = {"command": "connect", "port": str(port), "baudrate": 115200, "printerProfile": "_default"}
        self.ask("POST", "/api/connection", command)
        state = self._wait({"Operational"}, until)
        if state != "Operational":
            self._leave()
            return Outcome("octoprint", self._told(state), time.monotonic() - begun)
        started = time.monotonic()
        upload(OCTOPRINT, self.url, file, key=self._key, boundary=secrets.token_hex(16), start_print=True)
        state = self._wait({"Operational"}, until, done=True)
        outcome = Outcome(
            "octoprint", FINISHED if state == "Operational" else self._told(state), time.monotonic() - begun,
            time.monotonic() - started, tuple(self._complaints()),
        )  # fmt: skip
        self._leave()
        return outcome

    def _wait(self, wanted: set[str], until: float, *, done: bool = False) -> str:
        """Wait for a state (and, if `done`, for the whole job); returns the state that it ended with, "" for none."""
        state, printing = "", False
        while time.monotonic() < until:
            _, job = self.ask("GET", "/api/job")
            state = str(job["state"])
            if state in wanted and (not done or job["progress"]["completion"] == 100):
                return state
            if "rror" in state:
                return f"{state} {job.get('error', '')}".strip()
            if printing and state == "Operational":
                return "the job was cancelled"
            printing = printing or (done and state == "Printing")
            time.sleep(POLL_S)
        return "the job is paused" if state == "Paused" else ""

    def _told(self, state: str) -> str:
        return state or HANG

    def _complaints(self) -> list[str]:
        """Warnings and errors in its log that speak of the line."""
        log = self._folder / "logs" / "octoprint.log"
        lines = log.read_text(errors="replace").splitlines() if log.exists() else []
        return [
            line for line in lines if "octoprint.util.comm" in line and (" - WARNING" in line or " - ERROR" in line)
        ]

    def _leave(self) -> None:
        self.ask("POST", "/api/connection", {"command": "disconnect"})
        self._wait({"Offline"}, time.monotonic() + 15)
