"""PyBullet's setup: one private client, its ground and bodies, and the loading of robots.

Each setting below is there for a measured reason, given beside it; ``models/README.md`` describes what a URDF must
contain.
"""

from __future__ import annotations

from pathlib import Path

from messages.se3 import Pose3
from models.world import Box, WorldDescription
from services.runtime.errors import BadInput
from services.sim.physics._pybullet import pybullet, stdout_to_stderr
from services.sim.physics.collision_groups import BODY, GROUND, ROLLER, set_contact_dynamics
from services.sim.physics.world import GRAVITY, SOLVER_ITERATIONS
from services.sim.physics.world_bodies import LoadedWorld, load_bodies

_SPHERE = pybullet.GEOM_SPHERE


MAX_IDLE_CLIENTS = 2
"""Maximum number of closed clients that are kept: a world has two."""
_idle: list[int] = []


def connect(step: float) -> int:
    """Open a client without a window whose steps take ``step`` [s]; return its number."""
    client: int = _idle.pop() if _idle else pybullet.connect(pybullet.DIRECT)
    configure(client, step)
    return client


def disconnect(client: int, *, reusable: bool = True) -> None:
    """Close a client. If it is ``reusable``, it is emptied and kept for the next ``connect``: a new one takes 30 ms.

    Emptying resets everything but the light of the last image.
    """
    if reusable and len(_idle) < MAX_IDLE_CLIENTS:
        pybullet.resetSimulation(physicsClientId=client)
        _idle.append(client)
    else:
        pybullet.disconnect(physicsClientId=client)


def configure(client: int, step: float) -> None:
    """Apply the settings to a new or reset client."""
    pybullet.setPhysicsEngineParameter(
        fixedTimeStep=step,
        numSubSteps=0,
        numSolverIterations=SOLVER_ITERATIONS,
        solverResidualThreshold=0,  # never stop early: a resting robot creeps by 0.000 mm instead of 1 mm in 20 s
        useSplitImpulse=0,  # with it, a joint thrown 0.04 rad past its limit stays there forever
        deterministicOverlappingPairs=1,
        enableFileCaching=0,  # so that a changed URDF file is read again
        physicsClientId=client,
    )
    pybullet.setRealTimeSimulation(0, physicsClientId=client)
    pybullet.setGravity(0, 0, -GRAVITY, physicsClientId=client)


def load_world(client: int, world: WorldDescription) -> LoadedWorld:
    """Load the ground, whose number is 0, and the bodies into a client."""
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    ground = pybullet.createMultiBody(0, plane, physicsClientId=client)
    set_contact_dynamics(client, ground, -1, world.friction, GROUND)
    loaded = LoadedWorld({_load_box(client, box): box.name for box in world.boxes})
    load_bodies(client, world, loaded)
    return loaded


def _load_box(client: int, box: Box) -> int:
    half = [extent / 2 for extent in box.size]
    shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client)
    look = pybullet.createVisualShape(pybullet.GEOM_BOX, halfExtents=half, rgbaColor=box.colour, physicsClientId=client)
    orientation = Pose3.planar(0.0, 0.0, box.yaw).orientation
    number: int = pybullet.createMultiBody(0, shape, look, box.position, orientation, physicsClientId=client)
    set_contact_dynamics(client, number, -1, 0.5, BODY)
    return number


def load_urdf(client: int, urdf: Path, pose: Pose3, fixed: bool = False) -> int:
    """Load a URDF with its root frame at ``pose``, at rest, all motors off; return its number.

    With ``fixed`` the root is held in place. A link whose collision shape is a sphere rolls: it touches the ground and
    nothing else. Raises BadInput for a file that PyBullet cannot read.
    """
    try:
        with stdout_to_stderr():
            # Inertia from the file; otherwise shapes replace the tensors. Fixed links are not merged: merging ignores
            # where their masses are.
            number: int = pybullet.loadURDF(
                str(urdf),
                *pose,
                useFixedBase=fixed,
                flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
                physicsClientId=client,
            )
    except pybullet.error as error:
        raise BadInput(f"{urdf}: PyBullet cannot load this URDF ({error}); see stderr for the reason") from error
    for link in range(-1, pybullet.getNumJoints(number, physicsClientId=client)):
        friction = pybullet.getDynamicsInfo(number, link, physicsClientId=client)[1]
        set_contact_dynamics(client, number, link, friction, ROLLER if is_roller(client, number, link) else BODY)
        if link >= 0:
            # Every movable joint starts with a motor that brakes it.
            pybullet.setJointMotorControl2(number, link, pybullet.VELOCITY_CONTROL, force=0, physicsClientId=client)
    return number


def is_roller(client: int, number: int, link: int) -> bool:
    """Return whether a link of a body rolls, that is, collides as spheres."""
    shapes = pybullet.getCollisionShapeData(number, link, physicsClientId=client)
    return bool(shapes) and all(shape[2] == _SPHERE for shape in shapes)
