import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from gcodectl.jit import Kernel, jit, jit_inline, noting
from gcodectl.kernels import build, gateway, store
from gcodectl.kernels.fingerprint import fingerprint
from gcodectl.kernels.signature import spell

HELPER = "import limits\nfrom gcodectl.jit import jit\n@jit\ndef add_kernel(x):\n    return x + limits.STEP\n"
CALLER = (
    "from gcodectl.jit import jit\nfrom helper import add_kernel\n@jit\ndef top_kernel(x):\n"
    "    'Whatever.'\n    return add_kernel(x)\n"
)
RUN = "import caller, sys; print(caller.top_kernel(1), 'numba' in sys.modules)"


@pytest.fixture
def package(tmp_path: Path) -> Path:
    (tmp_path / "limits.py").write_text("STEP = 1\n")
    (tmp_path / "helper.py").write_text(HELPER)
    (tmp_path / "caller.py").write_text(CALLER)
    return tmp_path


def run(folder: Path, words: str = RUN, **more: str) -> str:
    path = os.pathsep.join([str(folder), *sys.path])
    environment = {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": str(folder / "kept"), **more}
    done = subprocess.run([sys.executable, "-c", words], env=environment, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_a_kernel_is_kept_until_something_in_it_changes(package: Path) -> None:
    assert run(package) == "2 True"
    assert run(package) == "2 False", "kept, and called without numba"
    (package / "caller.py").write_text(CALLER.replace("Whatever", "In other words") + "# and a comment\n")
    assert run(package) == "2 False"
    (package / "limits.py").write_text("STEP = 10\n")  # two modules away
    assert run(package) == "11 True"
    (package / "helper.py").write_text(HELPER.replace("+", "*"))
    assert run(package) == "10 True"
    assert run(package) == "10 False"
    assert len(list((package / "kept").rglob("*.o"))) == 1, "the old ones are gone"


def test_damaged_machine_code_is_made_again(package: Path) -> None:
    assert run(package) == "2 True"
    (kept,) = (package / "kept").rglob("*.o")
    kept.write_bytes(kept.read_bytes()[:-1] + b"?")
    assert run(package) == "2 True"
    assert run(package) == "2 False"


def test_what_a_killed_process_was_building_is_built_by_another(package: Path) -> None:
    assert run(package) == "2 True"
    (kept,) = (package / "kept").rglob("*.o")
    kept.unlink()
    gone = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, check=True)
    kept.with_suffix(".busy").write_bytes(gone.stdout.strip())
    assert run(package) == "2 True"
    assert kept.exists()
    assert not kept.with_suffix(".busy").exists()


def test_a_claim_that_is_too_old_is_nobodys(tmp_path: Path) -> None:
    path = tmp_path / "some.o"
    busy = path.with_suffix(".busy")
    busy.write_text(str(os.getppid()))  # lives, and may be anybody who has the number by now
    assert store.is_busy(path)
    assert not store.claim(path)
    os.utime(busy, (0.0, time.time() - store.LONGEST - 1.0))
    assert not store.is_busy(path)
    assert store.claim(path)


def test_without_a_folder_to_write_it_works_and_keeps_nothing(package: Path) -> None:
    (package / "file").write_text("")
    nowhere = str(package / "file" / "kept")  # not even root can write there
    words = f"import gcodectl.kernels.store as s; s._places = lambda: [s.Path({nowhere!r})]; {RUN}"
    assert run(package, words) == "2 True"
    assert run(package, words) == "2 True"


def test_numbers_arrays_and_tuples_go_in_and_come_out() -> None:
    @jit
    def parts_kernel(pair, rows, floor, deep):  # type: ignore[no-untyped-def]
        text, number = pair
        total = 0.0
        for k in range(rows.shape[0]):
            rows[k, 1] = number
            total += rows[k, 0]
        return len(text), total, total > floor, (deep[0], np.int8(3), text[1])

    rows = np.arange(6.0).reshape(3, 2)
    text = np.frombuffer(b"ab", dtype=np.uint8)  # read-only
    for strided in (rows, np.repeat(rows, 2, axis=1)[:, ::2]):
        found = parts_kernel((text, 7), strided, 5, (True,))
        assert found == (2, 6.0, True, (True, 3, 98))
        assert [type(one) for one in found[:3]] == [int, float, bool]
        assert strided[:, 1].tolist() == [7.0] * 3
    with pytest.raises(TypeError, match="numbers, arrays"):
        parts_kernel("ab", rows, 5, (True,))


def test_a_kernel_that_allocates_runs_with_numba() -> None:
    @jit_inline
    def twice_kernel(x):  # type: ignore[no-untyped-def]
        return 2 * x

    @jit
    def row_kernel(n):  # type: ignore[no-untyped-def]
        return np.full(n, twice_kernel(n))

    assert row_kernel(3).tolist() == [6, 6, 6]


def test_a_numba_made_otherwise_inside_calls_kernels_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    @jit
    def put_kernel(x, row):  # type: ignore[no-untyped-def]
        row[0] = x
        return x + 1.5

    def lacking(_: object) -> None:
        raise AttributeError("no such thing in this version")

    monkeypatch.setattr(build, "_inner_kernels_unoptimized", lacking)
    monkeypatch.setattr(store, "path_of", lambda *_: None)  # nothing of it may be kept
    row = np.zeros(1)
    assert put_kernel(1.0, row) == 2.5
    assert row[0] == 1.0


def test_one_signature_for_all_numbers_of_a_kind() -> None:
    spellings = []
    for arguments in ((1, 1.0, True), (np.int32(1), np.float32(1), np.bool_(1))):
        words: list[str] = []
        spell(arguments, words)
        spellings.append(words)
    assert spellings == [["i", "f", "b"]] * 2
    words = []
    spell([np.zeros((2, 3)), (np.zeros(4, np.int8)[::2],)], words)
    assert words == ["d2C", "(", "b1A", ")"]


@pytest.mark.parametrize("kind", [">f8", "O", "M8[s]"])
def test_arrays_of_what_no_kernel_reads_right_are_refused(kind: str) -> None:
    with pytest.raises(TypeError, match="byte order"):
        spell([np.zeros(2, kind)], [])


def test_kernels_are_noted_as_python_calls_them() -> None:
    @jit
    def inner_kernel(x):  # type: ignore[no-untyped-def]
        return x + 1

    @jit
    def outer_kernel(x):  # type: ignore[no-untyped-def]
        return inner_kernel(x) + 1

    with noting() as wanted:
        assert outer_kernel(1) == 3
        assert outer_kernel(1) == 3
        assert inner_kernel(1.0) == 2.0
    assert [(name.partition(":")[2], words) for name, words in wanted] == [("outer_kernel", "i"), ("inner_kernel", "f")]


def test_a_fingerprint_wants_to_know_all_that_is_named() -> None:
    strange = object()
    with pytest.raises(TypeError, match="no number, array, kernel or module"):
        fingerprint(lambda x: (x, strange))  # type: ignore[arg-type]


def test_threads_may_be_the_first_to_call() -> None:
    @jit
    def last_kernel(x):  # type: ignore[no-untyped-def]
        return x + 0.5

    found: list[float] = []
    threads = [threading.Thread(target=lambda: found.append(last_kernel(1.0))) for _ in range(4)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert found == [1.5] * 4
    assert isinstance(last_kernel, Kernel)
    assert store.path_of(last_kernel.name, last_kernel.fingerprint, "f") is not None


def test_a_gateway_turns_away_what_its_kernel_was_not_compiled_for() -> None:
    @jit
    def total_kernel(row, pair):  # type: ignore[no-untyped-def]
        total = pair[0] - pair[0]
        for k in range(len(row)):
            total += row[k]
        return total

    row = np.arange(6.0)
    of_all_kinds = (row, row.astype(np.int64), row.astype(np.float32), row.astype(np.int8), row[::2], row)
    for one in of_all_kinds:
        for other in (1, 1.0):  # each call after one of another kind
            found = total_kernel(one, (other,))
            assert found == one.sum()
            assert isinstance(found, int) == (one.dtype.kind == "i" and isinstance(other, int))
    with pytest.raises(TypeError, match="byte order"):
        total_kernel(row.astype(">f8"), (1.0,))
    with pytest.raises(TypeError, match="byte order"):
        total_kernel(np.array([None]), (1.0,))
    assert total_kernel(np.zeros((0,)), (np.float64(2.0),)) == 0.0


def test_where_numpy_keeps_its_arrays_otherwise_numba_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    @jit
    def first_kernel(row):  # type: ignore[no-untyped-def]
        return row[0, 1]

    monkeypatch.setattr("gcodectl.jit.WORKS", False)
    assert first_kernel(np.array([[1.0, 2.0]])) == 2.0
    monkeypatch.undo()
    assert gateway.WORKS
    assert first_kernel(np.array([[3, 4]])) == 4


def test_one_dtype_under_two_names_is_taken_under_each() -> None:
    @jit
    def sum_kernel(row):  # type: ignore[no-untyped-def]
        total = 0.0
        for k in range(len(row)):
            total += row[k]
        return total

    row = np.arange(4.0)
    for letter in "qlq":  # both of 8 bytes, both "<i8"
        assert sum_kernel(row.astype(letter)) == 6.0
    said_otherwise = row.view(row.dtype.newbyteorder("<" if sys.byteorder == "little" else ">"))
    assert said_otherwise.dtype == row.dtype
    for one in (said_otherwise, row, said_otherwise):
        assert sum_kernel(one) == 6.0
