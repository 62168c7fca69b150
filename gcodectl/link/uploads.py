"""Give a file to a host that streams by itself: Moonraker (Klipper) or OctoPrint, over their HTTP interface.

                POST, X-Api-Key               form fields besides `file`        answer
    Moonraker   /server/files/upload          root=gcodes path print checksum   201 {"item": {"path"}, "print_started"}
    OctoPrint   /api/files/local              path print                        201 {"files": {"local": {"path"}},
                                                                                     "effectivePrint"}

Rules: one request, never repeated, never redirected (the key would go along); nothing of the key is ever said, not even
where the server says it; what a server answers is data: shortened, made printable, then shown.

Sources: Moonraker, docs/external_api/file_manager.md "File upload" and components/application.py (FileUploadHandler:
422 where the checksum differs); OctoPrint, docs/api/files.rst "Upload file".
"""

from __future__ import annotations

import http.client
import json
import os
import socket
import ssl
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import SplitResult, urlsplit

from gcodectl.errors import DeviceError, DisconnectedError, InputError, NoAnswerError, NoPortError, UsageError
from gcodectl.link.address import address, shown, subfolder
from gcodectl.link.form import Form

CONNECT_S = 15.0
"""Seconds to wait for a connection."""
ANSWER_S = 120.0
"""Seconds to wait for one write or for the answer: a small board reads the whole file for its thumbnails first."""
_ANSWER_BYTES = 1_048_576


@dataclass(frozen=True)
class Service:
    """How one host program takes files: where, which fields, and where its answer says what became of it."""

    name: str
    endpoint: str
    key_variable: str
    key_hint: str
    fields: tuple[tuple[str, str], ...]
    checksum_field: str
    outcome: Callable[[dict[str, Any]], tuple[Any, Any]]
    """(path, whether the print began) from its answer."""


def _moonraker(answer: dict[str, Any]) -> tuple[Any, Any]:
    answer = answer.get("result", answer)
    return answer["item"]["path"], answer.get("print_started")


def _octoprint(answer: dict[str, Any]) -> tuple[Any, Any]:
    return answer["files"]["local"]["path"], answer.get("effectivePrint")


MOONRAKER = Service(
    "Moonraker", "/server/files/upload", "MOONRAKER_API_KEY", "`moonraker.conf`: [authorization], or its API key",
    (("root", "gcodes"),), "checksum", _moonraker,
)  # fmt: skip
OCTOPRINT = Service(
    "OctoPrint", "/api/files/local", "OCTOPRINT_API_KEY", "Settings, Application Keys", (), "", _octoprint
)


@dataclass(frozen=True)
class Uploaded:
    """What became of a file: where it lies on the host, and whether its print began (None: the host did not say)."""

    service: str
    url: str
    path: str
    bytes: int
    sha256: str
    checked: bool
    """Whether the host compared the sum with its own."""
    print_started: bool | None


def upload(
    service: Service, url: str, file: Path, *, key: str | None, boundary: str, start_print: bool = False,
    folder: str = "", answer_s: float = ANSWER_S,
) -> Uploaded:  # fmt: skip
    """Send `file` to `service` at `url`, into `folder` there; returns what it says became of it.

    Raises UsageError for the address or folder, InputError for the file, NoPortError where nothing listens,
    NoAnswerError where what listens says nothing it should, DisconnectedError where it hangs up, DeviceError where it
    refuses.
    """
    where = address(url)
    fields = dict(service.fields) | ({"path": subfolder(folder)} if folder else {})
    if start_print:
        fields["print"] = "true"
    with _opened(file) as (stream, size):
        form = Form(file.name, size, boundary, fields, service.checksum_field)
        headers = {"Accept": "application/json", "Content-Type": form.content_type, "Content-Length": str(form.length)}
        if key:
            headers["X-Api-Key"] = key
        host = _Host(service, where, key, answer_s)
        path, started = host.post(where.path.rstrip("/") + service.endpoint, headers, form, stream)
    return Uploaded(
        service.name, shown(where), path, size, form.sha256, bool(service.checksum_field),
        started if start_print else False,
    )  # fmt: skip


class _Host:
    """One connection to one host, for one request."""

    def __init__(self, service: Service, where: SplitResult, key: str | None, answer_s: float) -> None:
        self._service, self._key, self._answer_s = service, key, answer_s
        self._called = f"{service.name} at {shown(where)}"
        kind = http.client.HTTPSConnection if where.scheme == "https" else http.client.HTTPConnection
        assert where.hostname
        self._line = kind(where.hostname, where.port, timeout=CONNECT_S)

    def post(self, path: str, headers: dict[str, str], form: Form, stream: BinaryIO) -> tuple[str, bool | None]:
        """Send the form; return the path that the host gave the file, and whether the print began."""
        try:
            self._connect()
            status, location, text = self._exchange(path, headers, form, stream)
        except TimeoutError:
            late = f"did not answer within {self._answer_s:g} s; look there first: the file may have arrived"
            raise NoAnswerError(f"{self._called} {late}") from None
        except (ConnectionError, http.client.IncompleteRead):
            raise DisconnectedError(
                f"{self._called} hung up before it answered; look there before another try"
            ) from None
        except http.client.HTTPException:
            raise NoAnswerError(f"what answers is not {self._called}: it does not speak HTTP") from None
        finally:
            self._line.close()
        if not 200 <= status < 300:
            raise self._refused(status, location, text)
        try:
            place, started = self._service.outcome(json.loads(text))
        except (ValueError, LookupError, TypeError, AttributeError):
            raise NoAnswerError(
                f"what answers is not {self._called}: {self._plain(text) or 'it says nothing'}"
            ) from None
        return self._plain(str(place)), started if isinstance(started, bool) else None

    def _connect(self) -> None:
        try:
            self._line.connect()
        except ssl.SSLCertVerificationError as error:
            raise NoPortError(
                f"{self._called}: its certificate is not to be trusted ({error.verify_message})"
            ) from None
        except ssl.SSLError:
            raise NoPortError(f"{self._called} does not speak TLS; is it http://?") from None
        except socket.gaierror:
            raise NoPortError(f"{self._called}: there is no such host; is the name right?") from None
        except TimeoutError:
            raise NoPortError(f"{self._called} cannot be reached: no connection within {CONNECT_S:g} s") from None
        except UnicodeError:
            raise UsageError(f"{self._called}: that is no host name") from None
        except OSError as error:
            raise NoPortError(f"{self._called} cannot be reached: {error.strerror or error}") from None
        self._line.sock.settimeout(self._answer_s)

    def _exchange(self, path: str, headers: dict[str, str], form: Form, stream: BinaryIO) -> tuple[int, str, str]:
        """Send all; a host that refuses may hang up before that, and what it said then is still to be read."""
        with suppress(BrokenPipeError, ConnectionResetError):
            self._line.putrequest("POST", path, skip_accept_encoding=True)
            for name, value in headers.items():
                self._line.putheader(name, value)
            self._line.endheaders()
            for part in form.parts(stream):
                self._line.send(part)
        answer = self._line.getresponse()
        text = answer.read(_ANSWER_BYTES)
        if answer.length and len(text) < _ANSWER_BYTES:
            raise http.client.IncompleteRead(text)
        return answer.status, answer.headers.get("Location", ""), text.decode("utf-8", errors="replace")

    def _refused(self, status: int, location: str, text: str) -> DeviceError:
        said = self._said(text)
        if 300 <= status < 400:
            place = self._place(location)
            return DeviceError(f"{self._called} is elsewhere: it points to {place}; give that address, if it is yours")
        key = f"({self._service.key_hint}), from --api-key-file or {self._service.key_variable}"
        reasons = {
            401: f"wants an API key, or another one {key}",
            404: "has no such interface there; is the address right, and its folder if it has one?",
            409: "is printing the file of that name, or is busy; upload it under another name, or later",
            413: "takes no file that large; its limit is in its own settings, or those of the proxy before it",
            415: "takes no file of that kind; the name should end in .gcode",
            422: "got other bytes than were sent: its SHA-256 differs; upload it again",
        }  # fmt: skip
        key_is_wrong = status == 403 or (status == 400 and "CSRF" in said)  # OctoPrint takes us for a browser then
        reason = reasons.get(401 if key_is_wrong else status, "refused the file")
        return DeviceError(f"{self._called} {reason} (HTTP {status}{': ' + said if said else ''})")

    def _said(self, text: str) -> str:
        """What the host gives as its reason."""
        with suppress(ValueError, AttributeError):
            error = json.loads(text).get("error", "")
            return self._plain(str(error.get("message", "") if isinstance(error, dict) else error))
        return ""

    def _place(self, location: str) -> str:
        parts = urlsplit(location)
        place = f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}" if parts.netloc else ""
        return self._plain(place + parts.path.removesuffix(self._service.endpoint)) or "nowhere"

    def _plain(self, text: str) -> str:
        """Return a stranger's text fit to be shown: one line, printable, short, without the key."""
        text = text.replace(self._key, "***") if self._key else text
        return " ".join("".join(one if one.isprintable() else " " for one in text).split())[:200]


@contextmanager
def _opened(file: Path) -> Iterator[tuple[BinaryIO, int]]:
    """Open a regular file with something in it; yields it and its size, raises InputError for anything else."""
    if str(file) == "-":
        raise UsageError("an upload needs a file, whose size is known beforehand; standard input has none")
    try:
        if file.exists() and not file.is_file():
            raise InputError("is a folder or a device, not a G-code file", source=str(file))
        stream = file.open("rb")
    except FileNotFoundError:
        raise InputError("there is no such file", source=str(file)) from None
    except PermissionError:
        raise InputError("may not be read: check its permissions", source=str(file)) from None
    with stream:
        size = os.fstat(stream.fileno()).st_size
        if not size:
            raise InputError("is empty: nothing was sent", source=str(file))
        yield stream, size
