"""The camera's cells of the thermal bench: what they measure is there, and a target not met is said."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

from thermal_bench import camera


def test_cells_and_targets(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(camera, "LAYERS", 2)
    monkeypatch.setattr(camera, "TEMPERATURE", 0.1)
    (cell,) = camera.camera_cells([11], ["wall"])
    assert 0.2 < cell["temperature_rms"] < 2.0
    assert 0.0 < cell["registration_px"] < 2.0
    assert cell["scanned_rms"] > 10.0  # what the cleaning is for
    assert cell["occluded_frames"] > 3
    rows = camera.camera_targets([cell])
    assert [row["met"] for row in rows] == [False, False, True]
    assert all(row["interval"][0] <= row["value"] <= row["worst"] for row in rows)
    assert rows[2]["target"] == "<= 2"
