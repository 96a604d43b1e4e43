"""The controllers of a robot: which are running, which joints they claim, and the joints' targets at each tick."""

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

BEST_EFFORT = 0, 1
"""``strictness`` of a switch that skips what cannot be switched; with any other value nothing is switched then. As in
ROS, 0, the value of a request that does not set it, is best effort."""

State = Literal["initialized", "running", "stopped"]


class ControllerManager:
    """Owns the controllers. A joint belongs to one running controller at a time.

    Args:
        config: The controllers of the file.
        chosen: Controllers to start; if empty, all in the order of the file whose joints are not claimed yet.
        ports: Their access to the node.

    Raises:
        BadInput: A name in ``chosen`` does not exist, or two of them claim the same joint.
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
        """Running controllers that have started to command, at known joint states."""
        self.stopped_by = ""
        """Why no joint may be commanded at present; empty if commands are allowed."""
        chosen = tuple(chosen)
        for name in chosen:
            self._check_name(name)
        self._check_claims(chosen)
        self._start(chosen or tuple(self._configs))

    @property
    def running(self) -> tuple[str, ...]:
        """The running controllers, in the order of the file."""
        return tuple(name for name, state in self._states.items() if state == "running")

    def check_joints(self, limits: Mapping[str, JointLimits]) -> None:
        """Set the limits of the robot's joints; raises BadInput, with the place in the file, for a missing joint."""
        self._config.check_joints(limits)
        self._ports.limiter.limits = limits

    def list_controllers(self, _: Empty) -> ListControllersResponse:
        """List all controllers and their states."""
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

    def switch_controller(self, request: SwitchController, now: int = 0) -> SwitchControllerResponse:
        """Stop some controllers and start others; raises BadInput, with nothing changed, if that is impossible."""
        best_effort = request.strictness in BEST_EFFORT
        for name in (*request.start_controllers, *request.stop_controllers):
            if not best_effort:
                self._check_name(name)
        stop = [name for name in request.stop_controllers if name in self.running]
        start = [name for name in dict.fromkeys(request.start_controllers) if name in self._configs]
        if not best_effort:
            left = [name for name in self.running if name not in stop]
            self._check_claims((*left, *(name for name in start if name not in left)))
        for name in stop:
            self._states[name] = "stopped"
            self._halt(name, "the controller was stopped", now)
        self._start([name for name in start if name not in self.running])
        return SwitchControllerResponse(ok=True)

    def read(self, now: int) -> None:
        """Let every controller process its received commands."""
        for name, each in self._controllers.items():
            refusal = self.stopped_by
            if self._states[name] != "running":
                refusal = f"the controller {name} is stopped: switch_controller starts it"
            elif not refusal and name not in self._started:
                refusal = "it has not seen the joints yet"
            each.read(now, refusal)

    def halt(self, reason: str, now: int) -> None:
        """Stop commanding; all controllers restart once joint states are available again."""
        for name in tuple(self._started):
            self._halt(name, reason, now)
        for pid in self._hardware.values():
            pid.reset()

    def start(self, state: RobotState, now: int) -> None:
        """Start the running controllers that are not commanding yet at the joints' current positions."""
        for name in self.running:
            if name in self._controllers and name not in self._started:
                self._controllers[name].start(state, now)
                self._started.add(name)

    def update(self, state: RobotState, now: int, dt: float) -> tuple[JointTarget, ...]:
        """Return the targets of all commanded joints, ``dt`` [s] after the last ones."""
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
        """Convert the target to an effort if gazebo_ros_control has gains for the joint."""
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
        """Set controllers running, except those with a joint that another one has claimed."""
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
        """Return the claimed joints, each with its running controller."""
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
    """Create the controller of a kind; None for joint states, which the simulation publishes itself."""
    match config.kind:
        case "trajectory":
            return TrajectoryController(config, ports)
        case "joint" | "group":
            return JointController(config, ports)
    return None
