"""Plant: what any extruder model looks like from outside, and how one is named.

A plant takes u, the plunger's displacement rate as a volume rate, and gives q, the flow rate out of the nozzle, both in
mm^3/s. Time is cut into samples of `dt` seconds:

    u[k]  is held over [k dt, (k + 1) dt)
    q[k]  is the flow averaged over that same interval, so that sum(q) dt is the volume that came out, exactly

`--plant NAME` names a built-in one (`plant_models.builtin`), `--plant path/to/file.py:Attribute` anyone's own.
"""

from __future__ import annotations

import importlib.util
import inspect
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol, runtime_checkable

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import UsageError


@runtime_checkable
class Plant(Protocol):
    """An extruder: anything with these two methods serves wherever a plant is named.

    Deterministic: the same state and input give the same flow, and what is random was drawn from a seed when the plant
    was made. A run cut into pieces gives exactly the q of the run in one go. The state holds all that the plant
    remembers, noise-free; its length may change from run to run (a dead time keeps samples), and only the plant knows
    what is where.
    """

    def initial(self) -> Floats:
        """Return the state before the first sample: at rest, primed."""
        ...

    def run(self, state: Floats, u: Floats, dt: float) -> tuple[Floats, Floats]:
        """Return the state after len(u) samples, and q[n], mm^3/s; `state` and `u` are left as they were."""
        ...


def plant_names() -> tuple[str, ...]:
    """Names of the built-in plants."""
    return tuple(_recipes())


def load_plant(spec: str, *, seed: int = 0, flow: float | None = None, **parameters: float) -> Plant:
    """Return the plant that `spec` names: a built-in one, or `path/to/file.py:Attribute` (a Plant, or what makes one).

    `flow` is the nominal flow, mm^3/s, that a built-in's parameters are scaled to (None: its own). `gain` and `lag` are
    factors (1: as it is) that every built-in takes: on what comes out, and on how late, dead time aside. Raises
    UsageError that lists what there is, for an unknown name, file, attribute or parameter.
    """
    path, _, attribute = spec.rpartition(":")
    if path.endswith(".py") or spec.endswith(".py"):
        return _from_file(path, attribute, seed, flow, parameters) if path.endswith(".py") else _unnamed(spec)
    recipes = _recipes()
    if spec not in recipes:
        raise UsageError(f"there is no plant {spec!r}; built in: {', '.join(recipes)}, or give path/to/file.py:Name")
    recipe = recipes[spec]
    known = _parameter_names(recipe.build)
    for name in parameters:
        if name not in known:
            raise UsageError(f"plant {spec!r}: no such parameter as {name!r}; there are {', '.join(known)}")
    values = {**recipe.parameters, **parameters}
    plant: Plant = recipe.build(flow=recipe.flow if flow is None else flow, seed=seed, **values)
    return plant


def require(
    where: str, *, positive: Mapping[str, float] | None = None, least: Mapping[str, float] | None = None
) -> None:
    """Raise UsageError unless every number of `positive` is finite and > 0, of `least` >= 0 (infinity allowed)."""
    for name, value in (positive or {}).items():
        if not (math.isfinite(value) and value > 0):
            raise UsageError(f"plant {where}: {name} is {value:g}; it must be a positive number")
    for name, value in (least or {}).items():
        if not value >= 0:
            raise UsageError(f"plant {where}: {name} is {value:g}; it must not be negative")


def checked(u: Floats, dt: float) -> Floats:
    """Return u as a contiguous row of floats; what a plant is driven with is our own doing, so it is asserted."""
    row = np.ascontiguousarray(u, dtype=np.float64)
    assert row.ndim == 1, "u is one row of samples"
    assert dt > 0, "dt must be positive"
    assert bool(np.isfinite(row).all()), "u must be finite"
    return row


def _recipes() -> Mapping[str, Any]:
    from plant_models.builtin import RECIPES  # late: every plant in there imports this module

    return RECIPES


def _parameter_names(build: Callable[..., object]) -> list[str]:
    return [name for name in inspect.signature(build).parameters if name not in ("flow", "seed")]


def _unnamed(spec: str) -> Plant:
    found = ", ".join(_candidates(_load(spec))) or "nothing that could be a plant"
    raise UsageError(f"say which plant of {spec} is meant, as {spec}:Name; it has {found}")


def _from_file(path: str, attribute: str, seed: int, flow: float | None, parameters: Mapping[str, float]) -> Plant:
    module = _load(path)
    if not hasattr(module, attribute):
        there = ", ".join(_candidates(module)) or "nothing that could be a plant"
        raise UsageError(f"{path} has no {attribute!r}; it has {there}")
    found: object = getattr(module, attribute)
    where = f"{path}:{attribute}"
    if callable(found) and (isinstance(found, type) or not isinstance(found, Plant)):
        found = _call(where, found, {"seed": seed, "flow": flow}, parameters)
    elif parameters:
        raise UsageError(
            f"{where} is a plant already made and takes no {', '.join(parameters)}; name its class instead"
        )
    if not isinstance(found, Plant):
        raise UsageError(f"{where} is no plant: it needs initial() and run(state, u, dt); see plant_models.plant.Plant")
    return found


def _call(where: str, make: Any, offered: Mapping[str, object], parameters: Mapping[str, float]) -> object:
    """Call `make` with the parameters, and with those of `offered` that it takes."""
    signature = inspect.signature(make)
    takes_any = any(one.kind is inspect.Parameter.VAR_KEYWORD for one in signature.parameters.values())
    for name in parameters:
        if name not in signature.parameters and not takes_any:
            raise UsageError(
                f"{where}: no such parameter as {name!r}; there are {', '.join(signature.parameters) or 'none'}"
            )
    extra = {name: value for name, value in offered.items() if name in signature.parameters and value is not None}
    try:
        return make(**extra, **parameters)
    except TypeError as error:
        raise UsageError(f"{where} cannot be called: {error}") from error


def _load(path: str) -> ModuleType:
    if not Path(path).is_file():
        raise UsageError(f"there is no plant file {path}")
    spec = importlib.util.spec_from_file_location(f"plant_file_{Path(path).stem}", path)
    assert spec is not None, "a .py file has a loader"
    assert spec.loader is not None, "a .py file has a loader"
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise UsageError(f"the plant file {path} does not load: {type(error).__name__}: {error}") from error
    return module


def _candidates(module: ModuleType) -> list[str]:
    """Names in `module` that are plants or were defined there and can be called."""
    return [
        name
        for name, value in vars(module).items()
        if not name.startswith("_")
        and (getattr(value, "__module__", None) == module.__name__ if callable(value) else isinstance(value, Plant))
    ]
