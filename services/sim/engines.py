"""The physics engines by name, which of them are installed, and the factory of their worlds."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache
from importlib.util import find_spec
from typing import TYPE_CHECKING, Literal, get_args

from services.runtime.errors import BadInput

if TYPE_CHECKING:
    from models.world import WorldDescription
    from services.sim.physics.world import World

Engine = Literal["pybullet", "mujoco"]
ENGINES: tuple[Engine, ...] = get_args(Engine)

PYBULLET_PACKAGES = "PyBullet has packages only for Python 3.11 on x86_64"


@cache
def has_engine(engine: Engine) -> bool:
    """Return whether an engine's package is installed."""
    return find_spec(engine) is not None


def default_engine() -> Engine:
    """Return the default engine: PyBullet, the reference, or MuJoCo where that is not installed."""
    return "pybullet" if has_engine("pybullet") else "mujoco"


def check_engine(engine: Engine, where: str) -> None:
    """Raise BadInput if an engine is not installed; ``where`` names the setting that asks for it."""
    if has_engine(engine):
        return
    installed = [each for each in ENGINES if has_engine(each)]
    why = f" ({PYBULLET_PACKAGES})" if engine == "pybullet" else ""
    instead = f"omit the setting to use {installed[0]}" if installed else "remove .venv and run ./elea again"
    raise BadInput(f"{where}: the engine {engine} is not installed here{why}: {instead}")


def open_world(engine: Engine, description: WorldDescription, step_ns: int) -> AbstractContextManager[World]:
    """Return the world of a description in one engine, a context manager.

    Args:
        engine: The engine's name.
        description: Obstacles and ground.
        step_ns: Simulation time of one step, ns.

    Raises:
        BadInput: The engine is not installed.
    """
    check_engine(engine, "engine")
    if engine == "pybullet":
        from services.sim.physics.bullet import BulletWorld

        return BulletWorld(description, step_ns)
    from services.sim.physics.mujoco_world import MujocoWorld

    return MujocoWorld(description, step_ns)
