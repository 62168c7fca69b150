import threading
import time
from collections.abc import Iterator

import pytest

from gcodectl.prefetch import MOST, prefetch

ENOUGH = 30.0


def test_everything_comes_in_order_and_from_another_thread() -> None:
    made_in = []

    def source() -> Iterator[int]:
        for number in range(50):
            made_in.append(threading.current_thread())
            yield number

    assert list(prefetch(source())) == list(range(50))
    assert set(made_in) != {threading.current_thread()}
    assert list(prefetch(iter(list[int]()))) == []


def test_a_short_stream_stays_where_it_is() -> None:
    def source() -> Iterator[int]:
        for number in range(6):
            threads.append(threading.current_thread())
            yield number

    threads: list[threading.Thread] = []
    assert list(prefetch(source(), lambda number: number, 100)) == list(range(6))
    assert set(threads) == {threading.current_thread()}
    threads.clear()
    assert list(prefetch(source(), lambda number: number, 2)) == list(range(6))
    assert [thread is threading.current_thread() for thread in threads] == [True] * 3 + [False] * 3


def test_an_error_comes_where_its_item_would_have_come() -> None:
    def source() -> Iterator[int]:
        yield 1
        yield 2
        raise ValueError("the third")

    numbers = prefetch(source())
    assert [next(numbers), next(numbers)] == [1, 2]
    with pytest.raises(ValueError, match="the third"):
        next(numbers)


def test_what_is_there_comes_while_the_source_waits_for_more() -> None:
    more = threading.Event()

    def source() -> Iterator[int]:
        yield 1
        assert more.wait(ENOUGH)
        yield 2

    numbers = prefetch(source())
    assert next(numbers) == 1
    more.set()
    assert list(numbers) == [2]


def test_a_caller_who_wants_no_more_lets_the_thread_end_and_never_lets_it_run_far_ahead() -> None:
    made = []
    ended = threading.Event()

    def source() -> Iterator[int]:
        try:
            for number in range(1000):
                made.append(number)
                yield number
        finally:
            ended.set()

    numbers = prefetch(source())
    assert next(numbers) == 0
    numbers.close()
    assert ended.wait(ENOUGH)
    assert len(made) <= MOST + 4


def test_threads_end_whenever_their_caller_stops() -> None:
    before = threading.active_count()
    for _ in range(50):
        numbers = prefetch(iter(range(100)))
        assert [next(numbers), next(numbers)] == [0, 1]
        numbers.close()
    until = time.monotonic() + ENOUGH
    while threading.active_count() > before and time.monotonic() < until:
        time.sleep(0.01)
    assert threading.active_count() == before
