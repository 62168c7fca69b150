"""A web server on loopback that keeps what it is sent and answers what it is told to."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

MOONRAKER_SAYS = b'{"item": {"path": "cube.gcode", "root": "gcodes"}, "print_started": true, "action": "create_file"}'
OCTOPRINT_SAYS = (
    b'{"files": {"local": {"name": "cube.gcode", "path": "clay/cube.gcode"}}, "done": true, "effectivePrint": true}'
)


@dataclass
class Heard:
    """What the server got, and what it answers."""

    status: int = 201
    answer: bytes = MOONRAKER_SAYS
    headers: dict[str, str] = field(default_factory=dict)
    early: bool = False
    """Answer and hang up without having read the body."""
    url: str = ""
    path: str = ""
    got: dict[str, str] = field(default_factory=dict)
    body: bytes = b""


@contextmanager
def serving(heard: Heard) -> Iterator[Heard]:
    """Serve on a free port of loopback while the block runs."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            heard.path, heard.got = self.path, dict(self.headers)
            if not heard.early:
                heard.body = self.rfile.read(int(self.headers["Content-Length"]))
            self.send_response(heard.status)
            for name, value in heard.headers.items():
                self.send_header(name, value)
            self.send_header("Content-Length", str(len(heard.answer)))
            self.end_headers()
            self.wfile.write(heard.answer)
            self.close_connection = True

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        heard.url = f"http://127.0.0.1:{server.server_port}"
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            yield heard
        finally:
            server.shutdown()
            thread.join(30)
