import threading
import time

import pytest

from gcodectl.link.ahead import Ahead


def taken(ahead: Ahead[int]) -> list[int]:
    items = []
    for item in ahead:
        if item is None:
            time.sleep(0.001)
        else:
            items.append(item)
    return items


def test_all_items_come_in_order() -> None:
    assert taken(Ahead(range(1000), 7)) == list(range(1000))


def test_no_more_is_taken_than_stated_and_nothing_is_waited_for() -> None:
    given = 0
    gate = threading.Event()

    def source() -> object:
        nonlocal given
        for k in range(100):
            given = k + 1
            yield k
            if k == 49:
                gate.wait(30)

    ahead: Ahead[int] = Ahead(source(), 10)  # type: ignore[arg-type]
    ahead.wait()
    assert given <= 11
    assert [next(ahead) for _ in range(10)] == list(range(10))
    gate.set()
    rest = taken(ahead)
    assert rest == list(range(10, 100))


def test_an_error_comes_after_what_was_before_it() -> None:
    def source() -> object:
        yield 1
        raise ValueError("broken")

    ahead: Ahead[int] = Ahead(source(), 10)  # type: ignore[arg-type]
    ahead.wait()
    assert next(ahead) == 1
    with pytest.raises(ValueError, match="broken"):
        taken(ahead)
    with pytest.raises(StopIteration):
        next(ahead)


def test_a_closed_one_lets_its_source_be() -> None:
    ahead = Ahead(iter(int, 1), 3)
    ahead.wait()
    ahead.close()
    ahead._thread.join(30)
    assert not ahead._thread.is_alive()
