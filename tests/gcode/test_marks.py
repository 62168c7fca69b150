import pytest
from gcode_reading import moves_of

from gcodectl.gcode.dialects import FEATURES
from gcodectl.records import Moves


def last(text: str) -> Moves:
    return moves_of(text)[-1:]


@pytest.mark.parametrize(
    ("marks", "layer"),
    [
        ([";LAYER_CHANGE"], 0), ([";LAYER_CHANGE", ";LAYER_CHANGE\r"], 1), (["; CHANGE_LAYER", "; CHANGE_LAYER"], 1),
        ([";LAYER:0", ";LAYER:1"], 1), ([";LAYER:-2", ";LAYER:-2", ";LAYER:-1"], 1), ([";LAYER:0", ";LAYER_CHANGE"], 0),
        (["; LAYER_CHANGE now"], -1), ([";BEFORE_LAYER_CHANGE"], -1), ([";LAYER: x"], -1), ([";LAYER_COUNT:5"], -1),
    ],
)  # fmt: skip
def test_layers_by_marks(marks: list[str], layer: int) -> None:
    assert last("\n".join(marks)).layer[0] == layer


def test_layers_by_height_of_deposition() -> None:
    text = "M83\nG1 X0 Y0 Z.2 F600\nG1 X1 E1\nG1 Z5\nG1 X2\nG1 Z.2\nG1 X3 E1\nG1 Z.4\nG1 X4 E1\nG1 Z.42\nG1 X5 E1"
    layers = moves_of(text).layer.tolist()
    assert layers == [-1, -1, 0, 0, 0, 0, 0, 0, 1, 1, 1]
    assert last(text + "\n;LAYER_CHANGE\nG1 Z9\nG1 X9 E1").layer[0] == 0


@pytest.mark.parametrize(
    ("mark", "name"),
    [
        (";TYPE:External perimeter", "external perimeter"), ("; FEATURE: Outer wall", "external perimeter"),
        (";TYPE:WALL-OUTER", "external perimeter"),
        (";TYPE:SKIN\r", "solid infill"), (";TYPE:Skirt/Brim", "skirt"), (";TYPE:Prime tower", "wipe tower"),
        (";TYPE:Strange", "other"),
        (";type:Perimeter", ""), ("; TYPE Perimeter", ""), (";TYPE:SUPPORT-INTERFACE", "support interface"),
    ],
)  # fmt: skip
def test_features(mark: str, name: str) -> None:
    assert FEATURES[last(mark + "\nG1 X1").feature[0]] == name


def test_widths_and_heights() -> None:
    move = last(";WIDTH:0.45\n;HEIGHT:0.2\n; LAYER_HEIGHT = 9\n;WIDTH: none\nG1 X1")
    assert (move.width[0], move.height[0]) == (0.45, 0.2)
    move = last("; LINE_WIDTH: 0.42\n; LAYER_HEIGHT: 0.3")
    assert (move.width[0], move.height[0]) == (0.42, 0.3)
