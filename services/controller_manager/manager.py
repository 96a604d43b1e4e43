"""The controllers of a robot: which of them run, which joints they have, and the joints' targets at each tick."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal

from messages.controllers import ControllerState, ListControllersResponse, SwitchController, SwitchControllerResponse
from messages.joints import JointTarget
from messages.std import Empty
from models.urdf import JointLimits
from services.controller_manager.config import ControllerConfig, ManagerConfig, hardware_gain_set
from services.controller_manager.controller import MAX_GAP_S, Controller, Ports, RobotState
from services.controller_manager.joint_controller import JointController
from services.controller_manager.joint_pid import JointPid, PidParameters
from services.controller_manager.trajectory_controller import TrajectoryController
from services.runtime.errors import BadInput, unknown_name

BEST_EFFORT = 1
"""``strictness`` of a switch that leaves out what cannot be done; every other one then does nothing."""

State = Literal["initialized", "running", "stopped"]


class ControllerManager:
    """Owns the controllers. A joint belongs to one running controller at a time.

    Args:
        config: The controllers of the file.
        chosen: Those to start; empty for all, in the order of the file, whose joints no other one has by then.
        ports: How they reach the network.

    Raises:
        BadInput: A name in ``chosen`` does not exist, or two of them want one joint.
    """

    def __init__(self, config: ManagerConfig, chosen: Iterable[str], ports: Ports) -> None:
        self._config, self._ports = config, ports
        self._configs = {each.name: each for each in config.controllers}
        if len(self._configs) < len(config.controllers):
            names = [each.name for each in config.controllers]
            twice = next(each for each in names if names.count(each) > 1)
            raise BadInput(f"{self._configs[twice].where}: there are two controllers {twice!r}")
        self._states: dict[str, State] = dict.fromkeys(self._configs, "initialized")
        self._controllers = {name: each for name, one in self._configs.items() if (each := _make(one, ports))}
        self._hardware = {
            joint: JointPid(ports.announce(hardware_gain_set(joint), PidParameters.of(gains)))
            for joint, gains in config.hardware_gains.items()
        }
        self._started: set[str] = set()
        """Running controllers that have seen the joints."""
        self.stopped_by = ""
        """Why nothing may move at present; empty if it may."""
        chosen = tuple(chosen)
        for name in chosen:
            self._check_name(name)
        self._check_claims(chosen)
        self._start(chosen or tuple(self._configs))

    @property
    def running(self) -> tuple[str, ...]:
        """The controllers that run, in the order of the file."""
        return tuple(name for name, state in self._states.items() if state == "running")

    def check_joints(self, limits: Mapping[str, JointLimits]) -> None:
        """Take the limits of the robot's joints; raises BadInput, with the place in the file, for one that it lacks."""
        self._config.check_joints(limits)
        self._ports.limiter.limits = limits

    def list_controllers(self, _: Empty) -> ListControllersResponse:
        """All controllers and their states."""
        return ListControllersResponse(
            controller=tuple(
                ControllerState(
                    name=name,
                    state=self._states[name],
                    type=each.type,
                    claimed_interfaces=tuple(f"{joint}/{each.interface}" for joint in each.joints)
                    if self._states[name] == "running"
                    else (),
                )
                for name, each in self._configs.items()
            )
        )

    def switch_controller(self, asked: SwitchController, now: int = 0) -> SwitchControllerResponse:
        """Stop some controllers and start others; raises BadInput with nothing changed if that cannot be done."""
        best_effort = asked.strictness == BEST_EFFORT
        for name in (*asked.start_controllers, *asked.stop_controllers):
            if not best_effort:
                self._check_name(name)
        stop = [name for name in asked.stop_controllers if name in self.running]
        start = [name for name in asked.start_controllers if name in self._configs]
        if not best_effort:
            left = [name for name in self.running if name not in stop]
            self._check_claims((*left, *(name for name in start if name not in left)))
        for name in stop:
            self._states[name] = "stopped"
            self._halt(name, "the controller was stopped", now)
        self._start([name for name in start if name not in self.running])
        return SwitchControllerResponse(ok=True)

    def read(self, now: int) -> None:
        """Let every controller take what has come for it."""
        for name, each in self._controllers.items():
            refusal = self.stopped_by
            if self._states[name] != "running":
                refusal = f"the controller {name} is stopped: switch_controller starts it"
            elif not refusal and name not in self._started:
                refusal = "it has not seen the joints yet"
            each.read(now, refusal)

    def halt(self, reason: str, now: int) -> None:
        """Restart all controllers once the joints are seen again."""
        for name in tuple(self._started):
            self._halt(name, reason, now)
        for pid in self._hardware.values():
            pid.reset()

    def start(self, state: RobotState, now: int) -> None:
        """Let the running controllers that have not started yet begin where the joints are."""
        for name in self.running:
            if name in self._controllers and name not in self._started:
                self._controllers[name].start(state, now)
                self._started.add(name)

    def update(self, state: RobotState, now: int, dt: float) -> tuple[JointTarget, ...]:
        """The targets of all joints that are commanded, ``dt`` [s] after those before."""
        targets = []
        for name in self.running:
            if name in self._started:
                targets += self._controllers[name].update(state, now, dt)
        return tuple(self._by_effort(each, state, dt) for each in targets)

    def publish(self, now: int) -> None:
        """Let every controller publish its state."""
        for each in self._controllers.values():
            each.publish(now)

    def _by_effort(self, target: JointTarget, state: RobotState, dt: float) -> JointTarget:
        """The target as an effort, where gazebo_ros_control has gains for the joint."""
        joint = target.joint_name
        pid = self._hardware.get(joint)
        if pid is None or target.interface == "effort":
            return target
        reading = state[joint]
        error = target.value - (reading.position if target.interface == "position" else reading.velocity)
        effort = self._ports.limiter.effort(joint, pid.step(error, dt if dt <= MAX_GAP_S else 0.0))
        return JointTarget(joint_name=joint, interface="effort", value=effort)

    def _halt(self, name: str, reason: str, now: int) -> None:
        if name in self._started:
            self._started.discard(name)
            self._controllers[name].halt(reason, now)

    def _start(self, names: Iterable[str]) -> None:
        """Let controllers run, but those of which another one has a joint."""
        left_out = []
        for name in names:
            claimed = self._claimed()
            if taken := [joint for joint in self._configs[name].joints if joint in claimed]:
                left_out.append(f"{name} ({claimed[taken[0]]} has {taken[0]})")
            else:
                self._states[name] = "running"
        if left_out:
            self._ports.warn(f"not started, as others have their joints: {', '.join(left_out)}")

    def _claimed(self) -> dict[str, str]:
        """The joints of the running controllers, with these."""
        return {joint: name for name in self.running for joint in self._configs[name].joints}

    def _check_name(self, name: str) -> None:
        if name not in self._configs:
            raise unknown_name("controller", name, self._configs)

    def _check_claims(self, names: Iterable[str]) -> None:
        claimed: dict[str, str] = {}
        for name in names:
            for joint in self._configs[name].joints:
                if (other := claimed.setdefault(joint, name)) != name:
                    raise BadInput(f"{name} and {other} both claim the joint {joint}: stop one of them")


def _make(config: ControllerConfig, ports: Ports) -> Controller | None:
    """The controller of a kind; the joint states are the simulation's own."""
    match config.kind:
        case "trajectory":
            return TrajectoryController(config, ports)
        case "joint" | "group":
            return JointController(config, ports)
    return None
