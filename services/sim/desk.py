"""The requests that the simulation answers: models, states, resets, pause and single steps."""

from __future__ import annotations

from messages.elea import EmergencyStops, ModelState
from messages.geometry import Pose, Twist
from messages.requests import (
    DELETE,
    GET_STATE,
    LIST,
    LIST_STOPS,
    PAUSE,
    RELEASE_STOP,
    RESET,
    RESET_WORLD,
    RESUME,
    SET_DRIVE,
    SET_ODOMETRY,
    SET_STATE,
    SPAWN,
    STEP,
    Done,
    Name,
)
from messages.simulation import GetModelState, ModelList, SetModelState, SetOdometry, SimTime, SpawnModel, Steps
from messages.std import Empty
from models import UnknownModel
from models.figures import read_model
from services.runtime.errors import BadInput
from services.runtime.node import Node
from services.runtime.parameters.record import build
from services.sim import BaseParameters, JointParameters, RobotEntry
from services.sim.entities import frame_state, placed_in, pose_and_twist, seen_from
from services.sim.joints.desk import by_name
from services.sim.physics.rotation import into_world
from services.sim.physics.world import BodyState, Placement
from services.sim.stage import Stage
from services.sim.timing import Timing


class Desk:
    """Answers requests between two steps."""

    def __init__(self, stage: Stage, timing: Timing, node: Node) -> None:
        self._stage, self._timing = stage, timing
        self._stepping = False
        node.serve(SPAWN, self._spawn)
        node.serve(DELETE, self._delete)
        node.serve(LIST, self._list)
        node.serve(GET_STATE, self._get_state)
        node.serve(SET_STATE, self._set_state)
        node.serve(SET_ODOMETRY, self._set_odometry)
        node.serve(SET_DRIVE, lambda asked: stage.find(asked.name).change(asked, stage.now))
        node.serve(RESET, lambda _: self._restart(True))
        node.serve(RESET_WORLD, lambda _: self._restart(False))
        node.serve(PAUSE, lambda _: self._pause(True))
        node.serve(RESUME, lambda _: self._pause(False))
        node.serve(STEP, self._step)
        node.serve(LIST_STOPS, lambda _: EmergencyStops(stops=stage.stops.all))
        node.serve(RELEASE_STOP, lambda asked: Done(text=stage.release(asked.name, asked.holder)))

    def _spawn(self, asked: SpawnModel) -> ModelState:
        joints = by_name(asked.joint_names, asked.joint_positions)
        values = {each.name: each.value for each in asked.parameters}
        place = placed_in(frame_state(self._stage.world, asked.reference_frame), placement(asked.pose))
        try:
            wheeled = read_model(asked.model).wheels is not None
            entry = RobotEntry(
                name=asked.name,
                model=asked.model,
                namespace=asked.namespace,
                parameters=build(BaseParameters, values if wheeled else {}, asked.name),
                joint_parameters=build(JointParameters, {} if wheeled else values, asked.name),
                joints=joints,
            )
            return self._stage.spawn(entry, place).state()
        except UnknownModel as error:
            raise BadInput(str(error)) from None

    def _delete(self, asked: Name) -> Done:
        self._stage.delete(asked.name)
        return Done(text=f"{asked.name} is gone")

    def _list(self, _: Empty) -> ModelList:
        return ModelList(models=tuple(robot.state() for robot in self._stage.robots))

    def _get_state(self, asked: GetModelState) -> ModelState:
        robot = self._stage.find(asked.name)
        if not asked.relative_entity:
            return robot.state()
        world = self._stage.world
        pose, twist = pose_and_twist(seen_from(frame_state(world, asked.relative_entity), world.state(robot.name)))
        return ModelState(name=robot.name, model=robot.entry.model, pose=pose, twist=twist)

    def _set_state(self, asked: SetModelState) -> ModelState:
        robot, world = self._stage.find(asked.name), self._stage.world
        if robot.model.fixed_base and asked.twist != Twist():
            raise BadInput(f"{asked.name} is held in the world: it takes a pose, but no twist")
        frame = frame_state(world, asked.reference_frame)
        place = placed_in(frame, placement(asked.pose))
        axes = frame.orientation if asked.reference_frame else place.orientation
        v, w = asked.twist.linear, asked.twist.angular
        linear, angular = into_world(axes, (v.x, v.y, v.z)), into_world(axes, (w.x, w.y, w.z))
        world.set_state(asked.name, BodyState(place.position, place.orientation, linear, angular))
        if robot.model.fixed_base:
            self._stage.tell_frames()
        return robot.state()

    def _set_odometry(self, asked: SetOdometry) -> Done:
        self._stage.find(asked.name).telemetry.odometer.set(asked.x, asked.y, asked.yaw)
        self._stage.tell_frames()
        return Done(text=f"odometry of {asked.name} is at ({asked.x:g} m, {asked.y:g} m, {asked.yaw:g} rad) now")

    def _restart(self, time_too: bool) -> SimTime:
        self._stage.restart(time_too)
        self._timing.halt()
        return self._time()

    def _pause(self, paused: bool) -> SimTime:
        if self._stage.paused != paused:
            self._stage.paused = paused
            self._timing.halt()
            self._stage.tell_time()
        return self._time()

    def _step(self, asked: Steps) -> SimTime:
        if not self._stage.paused:
            raise BadInput("time is running: pause it before stepping")
        if self._stepping:
            raise BadInput("a step is under way already")
        stage = self._stage
        epoch, goal = stage.epoch, stage.tick + asked.count
        self._stepping = True
        try:
            while stage.tick < goal and stage.epoch == epoch:
                advance(stage, self._timing)
        finally:
            self._stepping = False
        stage.tell()
        return self._time()

    def _time(self) -> SimTime:
        stage = self._stage
        return SimTime(time=stage.now, tick=stage.tick, epoch=stage.epoch)


def advance(stage: Stage, timing: Timing) -> None:
    """Publish, wait and listen, once at each tick, then take one physics step.

    A pause that came with the wait holds time before the step; the next call takes it.
    """
    if not stage.held:
        stage.outbox.hold()  # until the timing holds
        stage.tell()
        epoch, tick = stage.epoch, stage.tick
        listening = timing.hold()
        if (stage.epoch, stage.tick) != (epoch, tick):
            return
        if listening:
            stage.listen(timing.marks, timing.factor)
        stage.held = True
        if stage.paused:
            return
    stage.advance()


def placement(pose: Pose) -> Placement:
    """A pose as the world takes it; raises BadInput when its quaternion has no direction."""
    p, q = pose.position, pose.orientation
    norm = (q.x**2 + q.y**2 + q.z**2 + q.w**2) ** 0.5
    if norm < 1e-6:
        raise BadInput("the orientation (0, 0, 0, 0) is no rotation; (0, 0, 0, 1) is the identity")
    return Placement((p.x, p.y, p.z), (q.x / norm, q.y / norm, q.z / norm, q.w / norm))
