"""Actuator: one imperfection of the drive, set before the plant that it drives; they nest like pipes.

    u --> [ Plunger ] --> [ DeadTime ] --> [ DriveLag ] --> [ Backlash ] --> reservoir --> q

Each is a Plant around a Plant, so that it can be tested alone (around `Direct`) and used around anything. The state is

    [ length of own | own ... | state of the inner plant ... ]
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from gcodectl.columns import Floats
from plant_models.plant import Plant, checked


class Direct:
    """The plant that obeys: q = u."""

    def initial(self) -> Floats:
        """Return an empty state."""
        return np.zeros(0)

    def run(self, state: Floats, u: Floats, dt: float) -> tuple[Floats, Floats]:
        """Return the state and u itself as q[n]."""
        return state.copy(), checked(u, dt).copy()


class Actuator(ABC):
    """A Plant that changes u before another Plant gets it; subclasses say how in `rest` and `move`."""

    def __init__(self, plant: Plant):
        self.plant = plant

    @abstractmethod
    def rest(self) -> Floats:
        """Return the actuator's own state at rest."""

    @abstractmethod
    def move(self, own: Floats, u: Floats, dt: float) -> tuple[Floats, Floats]:
        """Return the own state after u[n], and what really moves, [n], mm^3/s; `own` is left as it was."""

    def initial(self) -> Floats:
        """Return the state of actuator and plant at rest."""
        return join(self.rest(), self.plant.initial())

    def run(self, state: Floats, u: Floats, dt: float) -> tuple[Floats, Floats]:
        """Return the state after u[n] and the flow q[n] of the plant behind."""
        own, inner = split(state)
        own, moved = self.move(own, checked(u, dt), dt)
        inner, q = self.plant.run(inner, moved, dt)
        return join(own, inner), q


def join(own: Floats, rest: Floats) -> Floats:
    """Return [len(own), own, rest] as one state."""
    return np.concatenate([np.array([float(len(own))]), own, rest])


def split(state: Floats) -> tuple[Floats, Floats]:
    """Undo `join`."""
    length = int(state[0])
    return state[1 : 1 + length], state[1 + length :]
