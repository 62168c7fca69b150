"""The scene of a simulated photograph: material, ground, light, camera, and how the sheet lies, drawn from a seed.

What is drawn, and between what: the sheet up to 2.5 mm and 1.2 degrees off; the camera tilted up to 5 degrees each way
and turned up to 4; radial distortion of up to 4 % at the corners; vignetting down to 65 % and a gradient of 30 % across
the picture; ground and material with a texture of 1 to 4 %; a shadow that takes 5 to 45 % of the light beside a bead;
flanks up to 25 % darker than the bead's top; highlights; a blur of 0.7 to 1.5 px; shot noise; JPEG of quality 88 to 97.
The colours are rough reflectances of what is printed and printed on. These ranges are ours: of a careful amateur with a
phone, not of a laboratory, and not of a snapshot either.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.errors import UsageError

Colour = tuple[float, float, float]
"""Reflectance: blue, green, red."""
MATERIALS: dict[str, Colour] = {
    "silicone": (0.75, 0.78, 0.78), "terracotta": (0.10, 0.20, 0.42), "porcelain": (0.62, 0.70, 0.74),
    "graphite paste": (0.05, 0.05, 0.05), "blue hydrogel": (0.55, 0.25, 0.08), "grey PLA": (0.22, 0.22, 0.22),
    "red PLA": (0.04, 0.04, 0.45), "chocolate": (0.03, 0.05, 0.12),
}  # fmt: skip
GROUNDS: dict[str, Colour] = {
    "paper": (0.78, 0.80, 0.80), "dark glass": (0.035, 0.035, 0.03), "PEI": (0.03, 0.16, 0.34),
    "blue tape": (0.40, 0.22, 0.06), "steel": (0.30, 0.30, 0.30), "black PEI": (0.04, 0.04, 0.04),
}  # fmt: skip
LEAST_CONTRAST = 2.2
"""Material's over the ground's reflectance, or the reverse, in the colour where it is largest."""


@dataclasses.dataclass(frozen=True)
class Scene:
    """All that a photograph depends on besides the bead and the sheet."""

    seed: int
    """Of texture, noise and highlights."""
    material: str = "silicone"
    ground: str = "dark glass"
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the bed's point at the window's middle lies on the sheet: mm, mm from there; and its turn, degrees."""
    focal: float = 0.65
    """Diagonals."""
    tilt: tuple[float, float] = (0.0, 0.0)
    """Of the camera, degrees, about the picture's axes."""
    roll: float = 0.0
    """degrees"""
    radial: tuple[float, float] = (0.0, 0.0)
    vignetting: float = 0.0
    """Light lost at the corners."""
    gradient: tuple[float, float] = (0.0, 0.0)
    """Light gained from the middle to the right, and to the lower edge."""
    exposure: float = 0.8
    """Light that white paper gives in the middle; 1 fills the sensor."""
    texture: float = 0.0
    """Standard deviation of ground and material, relative."""
    shadow: float = 0.0
    """Light that the bead takes from the ground beside it."""
    shadow_side: float = 0.0
    """Where it falls, degrees from the picture's right, downwards."""
    flank: float = 0.0
    """Light that is lost at the bead's sides."""
    gloss: float = 0.0
    """Light of its highlights."""
    blur: float = 1.0
    """px, standard deviation."""
    noise: float = 0.01
    """Standard deviation at full light."""
    jpeg: int = 0
    """Quality; 0: not compressed."""

    def __post_init__(self) -> None:
        for name, known in ((self.material, MATERIALS), (self.ground, GROUNDS)):
            if name not in known:
                raise UsageError(f"there is no {name!r} to photograph; there are {', '.join(known)}")


def draw_scene(seed: int, *, lighter: bool | None = None) -> Scene:
    """Return the scene of a seed; `lighter`: the material lighter than the ground, or darker (None: either)."""
    rng = np.random.default_rng([seed, 11])
    pairs = [
        (m, g) for m in MATERIALS for g in GROUNDS
        if _contrast(m, g) >= LEAST_CONTRAST and lighter in (None, _mean(MATERIALS[m]) > _mean(GROUNDS[g]))
    ]  # fmt: skip
    material, ground = pairs[int(rng.integers(len(pairs)))]
    k1 = float(rng.uniform(-0.10, 0.06))
    return Scene(
        seed, material, ground,
        shift=(float(rng.uniform(-2.5, 2.5)), float(rng.uniform(-2.5, 2.5)), float(rng.uniform(-1.2, 1.2))),
        focal=float(rng.uniform(0.56, 0.85)), tilt=(float(rng.uniform(-5, 5)), float(rng.uniform(-5, 5))),
        roll=float(rng.uniform(-4, 4)), radial=(k1, float(rng.uniform(-0.3, 0.3)) * k1),
        vignetting=float(rng.uniform(0.1, 0.35)),
        gradient=(float(rng.uniform(-0.15, 0.15)), float(rng.uniform(-0.15, 0.15))),
        exposure=float(rng.uniform(0.6, 0.85)), texture=float(rng.uniform(0.01, 0.04)),
        shadow=float(rng.uniform(0.05, 0.45)), shadow_side=float(rng.uniform(0, 360)),
        flank=float(rng.uniform(0.0, 0.25)), gloss=float(rng.uniform(0.0, 0.5)), blur=float(rng.uniform(0.7, 1.5)),
        noise=float(rng.uniform(0.005, 0.02)), jpeg=int(rng.integers(88, 98)),
    )  # fmt: skip


def another_view(scene: Scene, seed: int) -> Scene:
    """Return the same material, ground, lamp and camera at another time: pose, focus and noise are others."""
    other = draw_scene(seed)
    return dataclasses.replace(
        scene, seed=seed, shift=other.shift, tilt=other.tilt, roll=other.roll, shadow_side=other.shadow_side,
        blur=other.blur,
    )  # fmt: skip


def _mean(colour: Colour) -> float:
    return sum(colour) / 3.0


def _contrast(material: str, ground: str) -> float:
    return max(max(a / b, b / a) for a, b in zip(MATERIALS[material], GROUNDS[ground], strict=True))
