import ctypes

import pytest

from gcodectl import memory


def test_freed_memory_is_kept_where_the_c_library_can(monkeypatch: pytest.MonkeyPatch) -> None:
    known = hasattr(ctypes.CDLL(None), "mallopt")
    assert memory.keep_freed_memory() is known
    monkeypatch.setattr(memory.ctypes, "CDLL", lambda _name: object())
    assert memory.keep_freed_memory() is False
