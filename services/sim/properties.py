"""The requests that ask what is there: the world and its physics, models, and links."""

from __future__ import annotations

from messages.gazebo import LinkName, LinkProperties, LinkState, ModelProperties, WorldProperties
from messages.geometry import Vector3
from messages.requests import LINK_PROPERTIES, LINK_STATE, MODEL_PROPERTIES, WORLD_PROPERTIES, Name
from messages.std import Empty, Time
from models.scene import Scene
from services.runtime.node import Node
from services.runtime.service import STEP_NS
from services.sim import SimParameters
from services.sim.entities import AT_REST, frame_state, link_named, pose_and_twist, seen_from
from services.sim.physics.world import GRAVITY, ITERATIONS, BodyState
from services.sim.stage import Stage
from services.sim.timing import Timing


class Properties:
    """Answers requests between two steps; of all this, only the factor of time can be set while a run lasts."""

    def __init__(self, stage: Stage, timing: Timing, node: Node, params: SimParameters, scene: Scene) -> None:
        self._stage, self._timing, self._world, self._params, self._scene = stage, timing, stage.world, params, scene
        node.serve(LINK_STATE, self._link_state)
        node.serve(LINK_PROPERTIES, self._link)
        node.serve(MODEL_PROPERTIES, self._model)
        node.serve(WORLD_PROPERTIES, self._all)

    def _link_state(self, asked: LinkName) -> LinkState:
        link = link_named(self._world, asked.link_name)
        seen = seen_from(frame_state(self._world, asked.reference_frame), self._world.link_state(*link))
        pose, twist = pose_and_twist(seen)
        return LinkState(link_name=str(link), pose=pose, twist=twist, reference_frame=asked.reference_frame or "world")

    def _link(self, asked: LinkName) -> LinkProperties:
        link = link_named(self._world, asked.link_name)
        found = self._world.inertia(*link)
        x, y, z = found.moments
        centre = BodyState(found.centre.position, found.centre.orientation, AT_REST.linear, AT_REST.angular)
        return LinkProperties(
            link_name=str(link),
            com=pose_and_twist(centre)[0],
            mass=found.mass,
            inertia=Vector3(x=x, y=y, z=z),
            friction=found.friction,
            wrenches=self._stage.wrenches.count(link),
        )

    def _model(self, asked: Name) -> ModelProperties:
        robot = self._stage.find(asked.name)
        links = self._world.links(robot.name)
        return ModelProperties(
            name=robot.name,
            model=robot.entry.model,
            about=robot.model.about,
            namespace=robot.namespace,
            base_frame=robot.telemetry.frame(robot.model.base_frame),
            links=links,
            joints=self._world.joints(robot.name),
            mass=sum(self._world.inertia(robot.name, link).mass for link in links),
            radius=robot.model.radius,
            is_static=robot.model.fixed_base,
            driven=robot.base is not None,
        )

    def _all(self, _: Empty) -> WorldProperties:
        stage, params = self._stage, self._params
        return WorldProperties(
            world=params.world,
            sim_time=Time.of(stage.now),
            tick=stage.tick,
            epoch=stage.epoch,
            mode=params.mode,
            factor=self._timing.factor,
            pause=stage.paused,
            time_step=STEP_NS / 1e9,
            gravity=Vector3(z=-GRAVITY),
            iterations=ITERATIONS,
            ground_friction=self._scene.friction,
            obstacles=tuple(box.name for box in self._scene.boxes),
            model_names=self._world.names,
        )
