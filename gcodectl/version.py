"""The version of the installed package."""

from __future__ import annotations


def version() -> str:
    """Return the installed version, as in pyproject.toml."""
    from importlib.metadata import version as installed

    return installed("gcodectl")
