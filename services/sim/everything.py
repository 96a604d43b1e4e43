"""The states of all models and of all links in one message each, as Gazebo told them, while somebody listens."""

from __future__ import annotations

from typing import Any

from messages.gazebo import LinkStates, ModelStates
from messages.topics import LINK_STATES, MODEL_STATES
from services.runtime.node import Node
from services.runtime.outputs import Output
from services.sim.entities import pose_and_twist
from services.sim.physics.world import World


class Everything:
    """Models in the order of their spawning, each with its links from the root on; all in the world's axes."""

    def __init__(self, node: Node, world: World) -> None:
        self._world = world
        self._models: Output[Any] = node.write(MODEL_STATES)
        self._links: Output[Any] = node.write(LINK_STATES)

    def tell(self) -> None:
        """Publish them as they are now."""
        world = self._world
        if self._models.wanted:
            told = [pose_and_twist(world.state(name)) for name in world.names]
            poses, twists = tuple(pose for pose, _ in told), tuple(twist for _, twist in told)
            self._models.publish(ModelStates(name=world.names, pose=poses, twist=twists))
        if self._links.wanted:
            links = [(name, link) for name in world.names for link in world.links(name)]
            told = [pose_and_twist(world.link_state(*each)) for each in links]
            poses, twists = tuple(pose for pose, _ in told), tuple(twist for _, twist in told)
            self._links.publish(LinkStates(name=tuple(map("::".join, links)), pose=poses, twist=twists))
