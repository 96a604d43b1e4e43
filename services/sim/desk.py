"""The requests that the simulation answers: models, states, resets, pause and single steps."""

from __future__ import annotations

from messages.elea import ModelState
from messages.geometry import Pose
from messages.requests import (
    DELETE,
    GET_STATE,
    LIST,
    PAUSE,
    RESET,
    RESET_WORLD,
    RESUME,
    SET_DRIVE,
    SET_ODOMETRY,
    SET_STATE,
    SPAWN,
    STEP,
    Done,
    ModelList,
    Name,
    SetModelState,
    SetOdometry,
    SimTime,
    SpawnModel,
    Steps,
)
from messages.std import Empty
from models import UnknownModel
from services.runtime.errors import BadInput
from services.runtime.node import Node
from services.sim import RobotEntry
from services.sim.rotation import into_world
from services.sim.stage import Stage
from services.sim.timing import Timing
from services.sim.world import BodyState, Placement


class Desk:
    """Answers requests between two steps."""

    def __init__(self, stage: Stage, timing: Timing, node: Node) -> None:
        self._stage, self._timing = stage, timing
        self._stepping = False
        node.serve(SPAWN, self._spawn)
        node.serve(DELETE, self._delete)
        node.serve(LIST, self._list)
        node.serve(GET_STATE, lambda asked: stage.find(asked.name).state())
        node.serve(SET_STATE, self._set_state)
        node.serve(SET_ODOMETRY, self._set_odometry)
        node.serve(SET_DRIVE, lambda asked: stage.find(asked.name).change(asked, stage.now))
        node.serve(RESET, lambda _: self._restart(True))
        node.serve(RESET_WORLD, lambda _: self._restart(False))
        node.serve(PAUSE, lambda _: self._pause(True))
        node.serve(RESUME, lambda _: self._pause(False))
        node.serve(STEP, self._step)

    def _spawn(self, asked: SpawnModel) -> ModelState:
        entry = RobotEntry(name=asked.name, model=asked.model, namespace=asked.namespace)
        try:
            return self._stage.spawn(entry, placement(asked.pose)).state()
        except UnknownModel as error:
            raise BadInput(str(error)) from None

    def _delete(self, asked: Name) -> Done:
        self._stage.delete(asked.name)
        return Done(text=f"{asked.name} is gone")

    def _list(self, _: Empty) -> ModelList:
        return ModelList(models=tuple(robot.state() for robot in self._stage.robots))

    def _set_state(self, asked: SetModelState) -> ModelState:
        robot = self._stage.find(asked.name)
        place = placement(asked.pose)
        v, w = asked.twist.linear, asked.twist.angular
        linear = into_world(place.orientation, (v.x, v.y, v.z))
        angular = into_world(place.orientation, (w.x, w.y, w.z))
        self._stage.world.set_state(asked.name, BodyState(place.position, place.orientation, linear, angular))
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
