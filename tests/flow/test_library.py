from __future__ import annotations

import contextlib
import io
import json
import zipfile

import numpy as np
import pytest
from flow_models import MODELS, PLUNGER
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gcodectl.errors import InputError, UsageError
from gcodectl.flow.exchange import from_csv, from_json, to_csv, to_json
from gcodectl.flow.library import (
    VERSION,
    BasisSet,
    BasisSignal,
    Library,
    builtin_libraries,
    load_library,
    open_library,
    save_library,
)
from gcodectl.records import TaskKind


def make_set(material="paste", nozzle=0.84, **changes):
    signals = {
        TaskKind.STOP: BasisSignal(np.array([4.0, -3.0, 1e-7]), lead=0.02),
        TaskKind.START: BasisSignal(np.array([1 / 3, 20.0]), lead=0.01),
        TaskKind.CORNER: BasisSignal(np.array([4.0, -3.0, 9.0, 4.0]), lead=0.015, dip=0.22),
        TaskKind.STEADY: BasisSignal(np.array([4.63])),
        TaskKind.NO_FLOW: BasisSignal(np.zeros(1)),
    }
    about = {"dt": 0.01, "flow": 5.0, "training": {"plant": "x", "rms": [1.0, 0.5], "note": 'a, "b"\n# c'}}
    return BasisSet(**{"material": material, "nozzle": nozzle, "signals": signals, **about, **changes})


def same(one, other):
    assert (one.material, one.nozzle, one.dt, one.flow) == (other.material, other.nozzle, other.dt, other.flow)
    assert dict(one.training) == dict(other.training)
    assert one.model == other.model
    for kind in TaskKind:
        np.testing.assert_array_equal(one.signals[kind].values, other.signals[kind].values)
        assert (one.signals[kind].lead, one.signals[kind].dip) == (other.signals[kind].lead, other.signals[kind].dip)
    return True


LIBRARY = Library((make_set(), make_set("clay", 0.5)))
values = arrays(np.float64, st.integers(1, 20), elements=st.floats(-1e6, 1e6))


@settings(deadline=None, max_examples=25)
@given(values, st.floats(-10, 10), st.text(min_size=1, max_size=12).filter(lambda s: s.isprintable()))
def test_a_library_comes_back_as_it_was(tmp_path_factory, samples, lead, material):
    signals = {**make_set().signals, TaskKind.START: BasisSignal(samples, lead=lead)}
    library = Library((make_set(material, signals=signals), make_set("clay", 0.5)))
    path = tmp_path_factory.mktemp("library") / "lib.npz"
    save_library(library, path)
    texts = (load_library(path), from_json(to_json(library)), from_csv(to_csv(library)))
    for again in texts:
        assert all(same(one, other) for one, other in zip(library.sets, again.sets, strict=True))


@pytest.mark.parametrize("structure", MODELS)
def test_a_flow_model_comes_back_with_its_set(tmp_path, structure):
    library = Library((make_set(model=MODELS[structure]), make_set("clay", 0.5)))
    path, again = tmp_path / "lib.npz", tmp_path / "again.npz"
    save_library(library, path)
    for found in (load_library(path), from_json(to_json(library)), from_csv(to_csv(library))):
        assert found.sets[0].model == MODELS[structure]
        assert found.sets[1].model is None
        save_library(found, again)
        assert again.read_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    "damage",
    [
        {"structure": "magic"},
        {"K": 0.0},
        {"K": None},
        {"store": "5"},
        {"delay": -1.0},
        {"colour": 3.0},
        {"flow": 1e999},
    ],
)
def test_a_damaged_flow_model_is_an_input_error(tmp_path, damage):
    text = to_json(Library((make_set(model=PLUNGER),)))
    document = json.loads(text)
    document["sets"][0]["model"].update(damage)
    with pytest.raises(InputError):
        from_json(json.dumps(document), "file")
    path = tmp_path / "lib.npz"
    save_library(Library((make_set(model=PLUNGER),)), path)
    with np.load(path) as archive:
        arrays_ = {name: archive[name] for name in archive.files}
    header = json.loads(arrays_["header"].tobytes())
    header["sets"][0]["model"].update(damage)
    arrays_["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    np.savez(path, **arrays_)
    with pytest.raises(InputError):
        load_library(path)


def test_a_model_that_lacks_what_it_must_have_is_an_input_error():
    document = json.loads(to_json(Library((make_set(model=PLUNGER),))))
    for wrong in ({"structure": "plunger"}, [], 5, "model", None):
        document["sets"][0]["model"] = wrong
        with pytest.raises(InputError):
            from_json(json.dumps(document), "file")


def test_the_same_library_gives_the_same_bytes(tmp_path):
    one, other = tmp_path / "a.npz", tmp_path / "b.npz"
    save_library(LIBRARY, one)
    save_library(load_library(one), other)
    assert one.read_bytes() == other.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.npz", "b.npz"]


def test_a_failed_save_leaves_the_old_file_whole(tmp_path):
    path = tmp_path / "a.npz"
    save_library(LIBRARY, path)
    before = path.read_bytes()
    with pytest.raises(ValueError, match="JSON"):
        save_library(Library((make_set(training={"rms": float("nan")}),)), path)
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.npz"]


def test_every_file_that_is_no_library_is_an_input_error(tmp_path):
    path = tmp_path / "lib.npz"
    save_library(LIBRARY, path)
    whole = path.read_bytes()
    with pytest.raises(InputError, match=r"lib\.npz.*No such file"):
        load_library(tmp_path / "missing" / "lib.npz")
    for junk in (b"", b"G1 X1\n", whole[:200], whole[: len(whole) // 2], b"PK\x03\x04" + bytes(50)):
        path.write_bytes(junk)
        with pytest.raises(InputError, match=r"lib\.npz"):
            load_library(path)
    for other in ({"x": np.zeros(3)}, {"header": np.frombuffer(b'{"format": "zoo"}', dtype=np.uint8)}):
        np.savez(path, **other)
        with pytest.raises(InputError, match="not a gcodectl library"):
            load_library(path)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 3000), st.integers(1, 255))
def test_a_flipped_byte_never_gets_past_as_another_error(tmp_path_factory, place, flip):
    path = tmp_path_factory.mktemp("library") / "lib.npz"
    save_library(LIBRARY, path)
    data = bytearray(path.read_bytes())
    data[place % len(data)] ^= flip
    path.write_bytes(bytes(data))
    with contextlib.suppress(InputError):
        load_library(path)


def test_a_newer_version_says_what_to_do(tmp_path):
    path = tmp_path / "lib.npz"
    header = json.dumps({"format": "gcodectl-library", "version": VERSION + 1, "sets": []}).encode()
    np.savez(path, header=np.frombuffer(header, dtype=np.uint8))
    with pytest.raises(InputError, match="please update"):
        load_library(path)
    with pytest.raises(InputError, match="please update"):
        from_json(to_json(LIBRARY).replace('"version": 1', '"version": 2'))
    with pytest.raises(InputError, match="please update"):
        from_csv(to_csv(LIBRARY).replace("gcodectl-library 1", "gcodectl-library 2"))


def test_nothing_is_unpickled(tmp_path):
    path = tmp_path / "lib.npz"
    with zipfile.ZipFile(path, "w") as archive:
        buffer = io.BytesIO()
        np.lib.format.write_array(buffer, np.array([{}], dtype=object), allow_pickle=True)
        archive.writestr("header.npy", buffer.getvalue())
    with pytest.raises(InputError, match="cannot be read"):
        load_library(path)


@pytest.mark.parametrize(
    ("read", "text"),
    [
        (from_json, "{"),
        (from_json, "[]"),
        (from_json, '{"format": "zoo"}'),
        (from_json, to_json(LIBRARY).replace('"lead": 0.02', '"lead": null')),
        (from_json, to_json(LIBRARY).replace('"Start"', '"Begin"')),
        (from_csv, "a,b\n1,2\n"),
        (from_csv, to_csv(LIBRARY).replace("K,3", "K,30")),
        (from_csv, "\n".join(to_csv(LIBRARY).splitlines()[:2])),
    ],
)
def test_text_that_is_no_library_is_an_input_error(read, text):
    with pytest.raises(InputError):
        read(text, "file")


@pytest.mark.parametrize("signal", [{"values": []}, {"values": [np.nan]}, {"values": [1.0], "lead": np.inf}])
def test_a_signal_must_be_numbers(signal):
    with pytest.raises(InputError, match="finite"):
        BasisSignal(**signal)


def test_a_set_must_be_complete():
    with pytest.raises(InputError, match="Corner"):
        make_set(signals={k: v for k, v in make_set().signals.items() if k is not TaskKind.CORNER})
    with pytest.raises(InputError, match="positive"):
        make_set(flow=0.0)


def test_the_matrix_is_the_papers():
    matrix = make_set().matrix()
    assert matrix.shape == (2 + 4, 5)
    np.testing.assert_array_equal(matrix[:2, TaskKind.CORNER], [0.015, 4])
    np.testing.assert_array_equal(matrix[2:, TaskKind.CORNER], [4.0, -3.0, 9.0, 4.0])
    assert np.isnan(matrix[4:, TaskKind.START]).all()


def test_sets_are_found_by_material_and_nearest_nozzle():
    library = Library((make_set("a", 0.4), make_set("a", 0.84), make_set("b", 0.4)))
    assert library.find("a", 0.8).nozzle == 0.84
    assert library.find("a").key == "a@0.4"
    with pytest.raises(UsageError, match=r"no material 'c'.*b@0\.4"):
        library.find("c")


def test_adding_replaces_the_same_material_and_nozzle():
    again = LIBRARY.add(make_set(flow=7.0)).add(make_set("new"))
    assert [(one.key, one.flow) for one in again.sets] == [("paste@0.84", 7.0), ("clay@0.5", 5.0), ("new@0.84", 5.0)]


def test_every_built_in_library_opens_and_is_named_after_its_material():
    built_in = builtin_libraries()
    assert {"paste-a", "paste-b"} <= set(built_in)
    for material, path in built_in.items():
        (one,) = load_library(path).sets
        assert one.material == material
        assert one.training["safe"]
        assert one.training["ratio"] < 0.6
        cap = one.training["limits"]["max_flow"]
        assert all(np.abs(signal.values).max() <= cap for signal in one.signals.values())
    assert len(open_library().sets) == len(built_in)
    assert open_library(built_in["paste-a"]).find("paste-a").steady == pytest.approx(1 / 1.08, rel=0.01)
