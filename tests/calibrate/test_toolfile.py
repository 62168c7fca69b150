from __future__ import annotations

import math
import os
from pathlib import Path

import pytest

from gcodectl.calibrate.toolfile import read_tool
from gcodectl.errors import InputError

TEXT = """// a tool file, made up
; by hand
DESCRIPTION 	10cc syringe, Green (0.8382) taper tip, anything
TIPDIAM		0.8382		//[mm]
PATHWIDTH	0.8 mm
PATHHEIGHT	0.7		//[mm]
PUSHOUT		.4 sec		//[s]
SUCKBACK	0.3
SUCKBACKDELAY	0.1
DEPOSITIONRATE  0.004
PATHSPEED	5
BARRELDIAM	15.8
MOTOR		3 -1 0.0004
"""
DATA = Path(os.environ.get("GCODECTL_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data") / "fabathome"


def written(folder, name="10ccGreenTaperLeft-FabEpoxy10wtGlass.tool", text=TEXT):
    path = folder / name
    path.write_text(text)
    return path


def test_what_a_file_says_becomes_parameters(tmp_path):
    one = read_tool(written(tmp_path))
    area = math.pi * 15.8**2 / 4
    attributes, parameters = one.calibration.attributes, one.calibration.parameters
    assert (attributes.material, attributes.nozzle_type, attributes.nozzle_diameter) == (
        "fab epoxy 10wt glass", "taper", 0.8382,
    )  # fmt: skip
    assert (attributes.path_width, attributes.path_height) == (0.8, 0.7)
    assert parameters.pushoutspeed == pytest.approx(5000 * 0.0004 * area) == parameters.pullbackspeed
    assert (parameters.pushouttime, parameters.acceldelay, parameters.pullbacktime) == (0.4, 0.4, 0.3)
    assert parameters.deceldelay == pytest.approx(0.2)
    assert parameters.inputspeed == pytest.approx(0.004 * 5 * area)
    assert parameters.outputspeed == 5.0
    assert parameters.inputaccel is None
    assert one.odd == ()


@pytest.mark.parametrize(
    ("name", "material", "nozzle"),
    [
        ("10ccRedTaperRight-ClearSilicone", "silicone", "taper"),
        ("10ccBlueTaperRight-White_silicone", "silicone", "taper"),
        ("ConductiveSilicone-AmberNeedle", "conductive silicone", "needle"),
        ("FabEpoxy - 10ccGreenTaperLeft", "fab epoxy", "taper"),
        ("10ccGreenTaperLeft-DP460NS", "dp460 ns epoxy", "taper"),
        ("10ccGreenTaperSoudalFixAllCrystal", "soudal fix all crystal", "taper"),
        ("KobaUVG1-GreenPrecision", "koba uvg1", None),
    ],
)
def test_names_tell_the_material_and_the_tip(tmp_path, name, material, nozzle):
    attributes = read_tool(written(tmp_path, f"{name}.tool")).calibration.attributes
    assert (attributes.material, attributes.nozzle_type) == (material, nozzle)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("PUSHOUT", "PUSHED", "has no PUSHOUT line"),
        ("0.7		//[mm]", "high", "line 6.*PATHHEIGHT is no number"),
        (".4 sec", "400 ms", "PUSHOUT is in 'ms', not s: please convert"),
        ("0.8 mm", "0.03 in", "PATHWIDTH is in 'in', not mm"),
        ("0.004", "0.04", "is no paste's: it deposits 14"),
        ("PATHSPEED	5", "PATHSPEED	0", "PATHSPEED is 0; it must be positive"),
        ("SUCKBACK	0.3", "SUCKBACK	-0.3", "must not be negative"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(tmp_path, old, new, said):
    assert old in TEXT
    with pytest.raises(InputError, match=said):
        read_tool(written(tmp_path, text=TEXT.replace(old, new)))


def test_files_that_are_none(tmp_path):
    for text in ("", "G1 X10 E2\nM104 S200\n", "\0\1\2" * 99):
        with pytest.raises(InputError, match="is no Fab@Home tool file"):
            read_tool(written(tmp_path, text=text))
    with pytest.raises(InputError, match="cannot be read"):
        read_tool(tmp_path / "none.tool")
    with pytest.raises(InputError, match="--material"):
        read_tool(written(tmp_path, "10ccRedTaperLeft.tool"))
    assert read_tool(written(tmp_path, "10ccRedTaperLeft.tool"), "clay").calibration.material == "clay"


def test_a_description_of_another_tip_is_odd(tmp_path):
    text = TEXT.replace("Green (0.8382)", "Red (0.25mm ID)")
    odd = read_tool(written(tmp_path, text=text)).odd
    assert [one.split(",")[0] for one in odd] == [
        "its description speaks of a 0.25 mm tip", "its description speaks of a red tip",
    ]  # fmt: skip


@pytest.mark.skipif(not DATA.is_dir(), reason="the Fab@Home files are not here")
def test_the_real_files():
    found, refused = [], []
    for file in sorted(DATA.glob("*.tool")):
        try:
            found.append(read_tool(file).calibration)
        except InputError as error:
            refused.append(str(error))
    assert len(found) == 40
    assert len({one.material for one in found}) == 14
    assert sum("--material" in one for one in refused) == 2
    assert sum("no paste" in one for one in refused) == 2  # ink and plastic
    fill = [
        one.parameters.inputspeed
        / (one.parameters.outputspeed * one.attributes.path_width * one.attributes.path_height)
        for one in found
    ]
    assert 1.0 < sorted(fill)[20] < 1.3
