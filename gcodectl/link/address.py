"""Where an upload goes: a host's address and a folder on it, checked before anything is sent."""

from __future__ import annotations

from urllib.parse import SplitResult, urlsplit

from gcodectl.errors import UsageError


def address(url: str) -> SplitResult:
    """Take a host's address apart; UsageError for what is none, or holds more than an address."""
    try:
        where = urlsplit(url)
        port = where.port
    except ValueError:
        raise UsageError("that address cannot be read; one looks like http://printer.local:7125") from None
    if where.username is not None or where.password is not None:
        raise UsageError("put no name or password into the address: others can read a command line; use an API key")
    if where.scheme not in ("http", "https") or not where.hostname or port == 0:
        raise UsageError(f"{url!r} is no address; one looks like http://printer.local:7125")
    if where.query or where.fragment or any(one <= " " or one > "~" for one in where.path):
        raise UsageError("give the address of the host alone, without ? or # or blanks")
    return where


def shown(where: SplitResult) -> str:
    """The address as messages say it."""
    return f"{where.scheme}://{where.netloc}{where.path.rstrip('/')}"


def subfolder(folder: str) -> str:
    """Return a folder below the host's own; UsageError for one that would leave it."""
    parts = folder.strip("/").split("/")
    if folder.startswith("/") or "\\" in folder or not folder.isprintable() or any(p in ("", ".", "..") for p in parts):
        raise UsageError(f"--path {folder!r}: give a folder below the host's own, as parts/clay")
    return "/".join(parts)
