"""A form with one file in it, as browsers send it, made as it is sent: a file of any size in a few kilobytes.

    --BOUNDARY                                            head: the plain fields, then how the file is called
    Content-Disposition: form-data; name="print"
                                                          (each line ends in CR LF)
    true
    --BOUNDARY
    Content-Disposition: form-data; name="file"; filename="cube.gcode"
    Content-Type: application/octet-stream

    ...the file's bytes...                                body: SHA-256 runs along
    --BOUNDARY
    Content-Disposition: form-data; name="checksum"       tail: the sum of what was sent, as long as any other sum

    9f86d081...
    --BOUNDARY--

The length is known before the first byte, because a SHA-256 is always 64 digits: servers refuse uploads without one,
and the file is read once only, so the sum is that of the bytes that went out.

Source: RFC 7578; names as the WHATWG's HTML standard has it ("multipart/form-data encoding algorithm"): UTF-8 as it is,
with `"`, CR and LF as %22, %0D and %0A. Moonraker and OctoPrint both see browsers daily.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import BinaryIO

from gcodectl.errors import InputError

CHUNK = 65_536
"""Bytes read and sent at once."""
_DIGITS = 64


@dataclass
class Form:
    """A form for the file `name` of `size` bytes; `parts` makes its bytes, after which `sha256` is what was sent."""

    name: str
    size: int
    boundary: str
    fields: Mapping[str, str] = field(default_factory=dict)
    checksum_field: str = ""
    sha256: str = ""

    @property
    def content_type(self) -> str:
        """What the request's Content-Type says."""
        return f"multipart/form-data; boundary={self.boundary}"

    @property
    def length(self) -> int:
        """Bytes of the whole form."""
        return len(self._head()) + self.size + len(self._tail("0" * _DIGITS))

    def parts(self, stream: BinaryIO) -> Iterator[bytes]:
        """Yield the form's bytes; InputError where the file no longer has the size that was told."""
        yield self._head()
        digest, left = hashlib.sha256(), self.size
        while left:
            chunk = stream.read(min(CHUNK, left))
            if not chunk:
                raise InputError("became shorter while it was being sent; upload it again", source=self.name)
            digest.update(chunk)
            left -= len(chunk)
            yield chunk
        if stream.read(1):
            raise InputError("became longer while it was being sent; upload it again", source=self.name)
        self.sha256 = digest.hexdigest()
        yield self._tail(self.sha256)

    def _head(self) -> bytes:
        fields = "".join(self._field(name) + f"\r\n\r\n{value}\r\n" for name, value in self.fields.items())
        file = self._field("file") + f'; filename="{_escaped(self.name)}"\r\nContent-Type: application/octet-stream'
        return f"{fields}{file}\r\n\r\n".encode(errors="replace")

    def _tail(self, digits: str) -> bytes:
        checksum = self._field(self.checksum_field) + f"\r\n\r\n{digits}\r\n" if self.checksum_field else ""
        return f"\r\n{checksum}--{self.boundary}--\r\n".encode()

    def _field(self, name: str) -> str:
        return f'--{self.boundary}\r\nContent-Disposition: form-data; name="{name}"'


def _escaped(name: str) -> str:
    return "".join(f"%{ord(one):02X}" if one == '"' or one < " " else one for one in name)
