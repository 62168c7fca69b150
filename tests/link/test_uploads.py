"""Uploads: the form byte for byte, what hosts answer, what goes wrong on the way."""

from __future__ import annotations

import hashlib
import socket
import threading
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from loopback import OCTOPRINT_SAYS, Heard, serving

from gcodectl.errors import (
    DeviceError,
    DisconnectedError,
    GcodectlError,
    InputError,
    NoAnswerError,
    NoPortError,
    UsageError,
)  # fmt: skip
from gcodectl.link.form import CHUNK, Form
from gcodectl.link.uploads import MOONRAKER, OCTOPRINT, Service, Uploaded, upload

CUBE = b"G28\r\nG1 X10 E1 ; --BOUNDARY--\xff\n"
KEY = "3cr3t-0f-the-printer"


@pytest.fixture
def cube(tmp_path: Path) -> Path:
    path = tmp_path / "cube.gcode"
    path.write_bytes(CUBE)
    return path


def send(
    url: str, file: Path, *, service: Service = MOONRAKER, start_print: bool = False, folder: str = "",
    key: str | None = KEY, answer_s: float = 30.0,
) -> Uploaded:  # fmt: skip
    return upload(
        service, url, file, key=key, boundary="BOUNDARY", start_print=start_print, folder=folder, answer_s=answer_s
    )


def part(name: str, value: str) -> bytes:
    return f'--BOUNDARY\r\nContent-Disposition: form-data; name="{name}"\r\n\r\n{value}\r\n'.encode()


def file_part(name: str, content: bytes) -> bytes:
    head = f'--BOUNDARY\r\nContent-Disposition: form-data; name="file"; filename="{name}"\r\n'
    return head.encode() + b"Content-Type: application/octet-stream\r\n\r\n" + content + b"\r\n"


def test_moonraker_gets_the_form_byte_for_byte(cube: Path):
    with serving(Heard()) as heard:
        done = send(heard.url, cube, start_print=True, folder="clay/red")
    total = hashlib.sha256(CUBE).hexdigest()
    expected = (
        part("root", "gcodes") + part("path", "clay/red") + part("print", "true") + file_part("cube.gcode", CUBE)
        + part("checksum", total) + b"--BOUNDARY--\r\n"
    )  # fmt: skip
    assert heard.body == expected
    assert heard.path == "/server/files/upload"
    assert heard.got["X-Api-Key"] == KEY
    assert heard.got["Content-Type"] == "multipart/form-data; boundary=BOUNDARY"
    assert "Transfer-Encoding" not in heard.got
    assert done == Uploaded("Moonraker", heard.url, "cube.gcode", len(CUBE), total, True, True)


def test_octoprint_gets_its_own(cube: Path):
    with serving(Heard(answer=OCTOPRINT_SAYS)) as heard:
        done = send(f"{heard.url}/octo/", cube, service=OCTOPRINT, start_print=True, folder="clay/")
    assert heard.path == "/octo/api/files/local"
    assert (
        heard.body == part("path", "clay") + part("print", "true") + file_part("cube.gcode", CUBE) + b"--BOUNDARY--\r\n"
    )
    assert (done.path, done.checked, done.print_started) == ("clay/cube.gcode", False, True)
    assert done.url == f"{heard.url}/octo"


def test_no_print_is_asked_for_unless_told(cube: Path):
    with serving(Heard()) as heard:
        done = send(heard.url, cube, key=None)
    assert b'"print"' not in heard.body
    assert "X-Api-Key" not in heard.got
    assert done.print_started is False


@pytest.mark.parametrize(
    ("name", "sent"),
    [
        ('a "b".gcode', "a %22b%22.gcode"),
        ("würfel 立方.gcode", "würfel 立方.gcode"),
        ("a\r\nX-Evil: 1.gcode", "a%0D%0AX-Evil: 1.gcode"),
    ],
)
def test_names_are_escaped_as_browsers_do(tmp_path: Path, name: str, sent: str):
    path = tmp_path / name
    path.write_bytes(CUBE)
    with serving(Heard()) as heard:
        send(heard.url, path)
    assert file_part(sent, CUBE) in heard.body


def test_memory_stays_flat(tmp_path: Path):
    size = 64 * CHUNK + 17
    big = tmp_path / "big.gcode"
    with big.open("wb") as file:
        file.truncate(size)
    form = Form("big.gcode", size, "B", {}, "checksum")
    with big.open("rb") as stream:
        tracemalloc.start()
        sent = sum(len(one) for one in form.parts(stream))
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert sent == form.length
    assert peak < 6 * CHUNK
    assert form.sha256 == hashlib.sha256(bytes(size)).hexdigest()


@pytest.mark.parametrize(("size", "word"), [(len(CUBE) + 1, "shorter"), (len(CUBE) - 1, "longer")])
def test_a_file_that_changes_meanwhile_is_not_sent_whole(cube: Path, size: int, word: str):
    with cube.open("rb") as stream, pytest.raises(InputError, match=word):
        list(Form("cube.gcode", size, "B").parts(stream))


REFUSALS = [
    (400, b'{"error": "CSRF validation failed"}', "API key"),
    (400, b'{"error": "No file"}', r"refused the file \(HTTP 400: No file\)"),
    (401, b"", "API key"),
    (403, b'{"error": "no rights"}', r"API key.*MOONRAKER_API_KEY.*HTTP 403: no rights"),
    (404, b"", "address"),
    (409, b"", "busy"),
    (413, b"<html>", "large"),
    (415, b"", "kind"),
    (422, b'{"error": {"code": 422, "message": "File checksum mismatch"}}', "SHA-256 differs.*mismatch"),
    (500, b"\x00\xff{", r"refused the file \(HTTP 500\)"),
    (507, b"[1]", r"refused the file \(HTTP 507\)"),
]


@pytest.mark.parametrize(("status", "answer", "said"), REFUSALS)
def test_a_refusal_says_why_and_what_to_do(cube: Path, status: int, answer: bytes, said: str):
    with serving(Heard(status=status, answer=answer)) as heard, pytest.raises(DeviceError, match=said) as caught:
        send(heard.url, cube)
    assert caught.value.exit_status == 5


def test_a_refusal_before_the_end_is_still_read_or_told(tmp_path: Path):
    """A host that refuses early hangs up on us; what it said then is read where the system still has it."""
    big = tmp_path / "big.gcode"
    with big.open("wb") as file:
        file.truncate(40_000_000)
    with serving(Heard(status=413, answer=b"", early=True)) as heard, pytest.raises(DeviceError) as caught:
        send(heard.url, big)
    assert caught.value.exit_status in (5, 13)
    assert "large" in str(caught.value) or "hung up" in str(caught.value)


def test_the_key_is_never_said_not_even_by_the_host(cube: Path):
    answer = b'{"error": "key ' + KEY.encode() + b' is\\nno\\u001b[31mgood"}'
    with serving(Heard(status=403, answer=answer)) as heard, pytest.raises(DeviceError) as caught:
        send(heard.url, cube)
    assert KEY not in str(caught.value)
    assert "key *** is no [31mgood" in str(caught.value)


@pytest.mark.parametrize(
    ("location", "said"),
    [
        ("https://user:word@printer.local/server/files/upload", "points to https://printer.local;"),
        ("/login?next=1", "points to /login;"),
        ("", "points to nowhere;"),
    ],
)
def test_a_redirect_is_told_not_followed(cube: Path, location: str, said: str):
    headers = {"Location": location} if location else {}
    with serving(Heard(status=301, headers=headers)) as heard, pytest.raises(DeviceError, match=said):
        send(heard.url, cube)


@pytest.mark.parametrize("answer", [b"", b"hello", b"[]", b'{"item": 3}', b'{"files": {}}'])
def test_another_program_at_that_address(cube: Path, answer: bytes):
    with serving(Heard(answer=answer)) as heard, pytest.raises(NoAnswerError, match="not Moonraker"):
        send(heard.url, cube)


@contextmanager
def raw(reply: bytes | None) -> Iterator[str]:
    """A bare socket: reads a request and answers these bytes (None: nothing, for as long as the block runs)."""
    over = threading.Event()

    def serve() -> None:
        line, _ = listening.accept()
        with line:
            heard = b""
            while b"--BOUNDARY--" not in heard and (more := line.recv(65_536)):
                heard += more
            if reply is None:
                over.wait(30)
            else:
                line.sendall(reply)

    with socket.create_server(("127.0.0.1", 0)) as listening:
        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield f"http://127.0.0.1:{listening.getsockname()[1]}"
        finally:
            over.set()
            thread.join(30)


@pytest.fixture
def plain(tmp_path: Path) -> Path:
    path = tmp_path / "plain.gcode"
    path.write_bytes(b"G28\n")
    return path


@pytest.mark.parametrize(
    ("reply", "error", "said"),
    [
        (None, NoAnswerError, "did not answer within 0.2 s"),
        (b"", DisconnectedError, "hung up"),
        (b"start\nok\n", NoAnswerError, "does not speak HTTP"),
        (b"HTTP/1.1 201 Created\r\nContent-Length: 99\r\n\r\n{", DisconnectedError, "hung up"),
    ],
)
def test_a_host_that_answers_badly(plain: Path, reply: bytes | None, error: type[GcodectlError], said: str):
    with raw(reply) as url, pytest.raises(error, match=said):
        send(url, plain, answer_s=0.2 if reply is None else 30.0)


def test_nothing_listens(cube: Path):
    with socket.create_server(("127.0.0.1", 0)) as free:
        url = f"http://127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(NoPortError, match=r"cannot be reached: .*refused"):
        send(url, cube)


def test_tls_is_tried_and_checked(cube: Path):
    with serving(Heard()) as heard, pytest.raises(NoPortError, match=r"TLS; is it http://"):
        send(heard.url.replace("http:", "https:"), cube)


@pytest.mark.parametrize(
    "url",
    ["printer.local", "ftp://printer", "http://", "http://a:b", "http://a:70000", "http://a/?x=1", "http://a/#x",
     "http://a/ b", "http://[::1", "http://a:0"],
)  # fmt: skip
def test_no_address(cube: Path, url: str):
    with pytest.raises(UsageError):
        send(url, cube)


def test_a_password_in_the_address_is_refused_unsaid(cube: Path):
    with pytest.raises(UsageError, match="no name or password") as caught:
        send("http://user:hush@printer.local", cube)
    assert "hush" not in str(caught.value)


def test_a_host_name_that_cannot_be(cube: Path):
    with pytest.raises((UsageError, NoPortError)):
        send(f"http://{'x' * 70}.invalid", cube)


@pytest.mark.parametrize("folder", ["../config", "/etc", "a/../b", "a//b", "a\\b", "a\nb", "."])
def test_folders_stay_below_the_hosts_own(cube: Path, folder: str):
    with pytest.raises(UsageError, match="--path"):
        send("http://127.0.0.1:9", cube, folder=folder)


def test_files_that_cannot_be_sent(tmp_path: Path):
    empty = tmp_path / "empty.gcode"
    empty.touch()
    for path, said in ((tmp_path / "none.gcode", "no such file"), (tmp_path, "folder"), (empty, "empty")):
        with pytest.raises(InputError, match=said):
            send("http://127.0.0.1:9", path)
    with pytest.raises(UsageError, match="standard input"):
        send("http://127.0.0.1:9", Path("-"))
