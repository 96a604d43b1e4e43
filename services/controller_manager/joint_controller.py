"""Controllers of one joint or a group, each joint commanded by a number: forwarded, or through a PID."""

from __future__ import annotations

from typing import Any

from messages.control import JointControllerState
from messages.joints import JointTarget
from messages.std import Float64, Float64MultiArray, Header, Time
from messages.topics import Quality, Topic
from services.controller_manager.config import ControllerConfig
from services.controller_manager.controller import MAX_GAP_S, Due, Ports, RobotState
from services.controller_manager.joint_pid import JointPid, PidParameters

STATE_RATE = 50.0
"""Publishing rate [Hz] of the state of a controller with a PID."""


class JointController:
    """The controllers of ``position_controllers``, ``velocity_controllers`` and ``effort_controllers`` that are
    commanded by one number per joint, and ROS 2's ForwardCommandController.

    From its start until the first command, it holds its joints: at their positions, at rest, or without effort.
    """

    def __init__(self, config: ControllerConfig, ports: Ports) -> None:
        self.config, self._ports = config, ports
        single = config.kind == "joint"
        record: Any = Float64 if single else Float64MultiArray
        names = ("command",) if single else ("command", "commands")
        self._commands = [
            ports.stream(
                Topic(f"{config.name}/{each}", record, 0, Quality.COMMAND, f"{config.commanded} of the joints")
            )
            for each in names
        ]
        self._pids: dict[str, JointPid] = {}
        for joint, gains in config.gains.items():
            self._pids[joint] = JointPid(ports.announce(config.gain_set(joint), PidParameters.of(gains)))
        self._states = None
        if single and self._pids:
            topic = Topic(
                f"{config.name}/state", JointControllerState, STATE_RATE, Quality.SENSOR, "state of the joint"
            )
            self._states = ports.advertise(topic)
        self._due = Due(STATE_RATE)
        self._set_points: dict[str, float] = {}
        self._commanded_at: int | None = None
        self._last_state: JointControllerState | None = None

    def read(self, now: int, refusal: str) -> None:
        """Process the received commands; the newest valid one counts."""
        for stream in self._commands:
            for message in stream.drain():
                values = (message.data,) if isinstance(message, Float64) else message.data
                if refusal:
                    self._ports.warn(f"{self.config.name}: a command is refused: {refusal}")
                elif len(values) != len(self.config.joints):
                    self._ports.warn(
                        f"{self.config.name}: a command of {len(values)} numbers is refused: the controller has "
                        f"{len(self.config.joints)} joints ({', '.join(self.config.joints)})"
                    )
                else:
                    self._set_points = {j: self._limited(j, v) for j, v in zip(self.config.joints, values, strict=True)}
                    self._commanded_at = now

    def start(self, state: RobotState, now: int) -> None:
        """Hold the joints at their positions, or at rest."""
        held = self.config.commanded == "position"
        self._set_points = {joint: state[joint].position if held else 0.0 for joint in self.config.joints}
        self._commanded_at = None
        for pid in self._pids.values():
            pid.reset()

    def halt(self, reason: str, now: int) -> None:
        """Discard the command."""
        self._set_points, self._last_state, self._commanded_at = {}, None, None

    def update(self, state: RobotState, now: int, dt: float) -> list[JointTarget]:
        """Return the targets of the joints."""
        timeout = self._ports.command_timeout()
        silent = 0.0 if self._commanded_at is None else (now - self._commanded_at) / 1e9
        if self.config.commanded != "position" and 0 < timeout < silent:
            self._ports.warn(f"{self.config.name}: no command for {timeout:g} s, its joints are stopped")
            self._set_points, self._commanded_at = dict.fromkeys(self._set_points, 0.0), None
        return [self._target(joint, set_point, state, now, dt) for joint, set_point in self._set_points.items()]

    def publish(self, now: int) -> None:
        """Publish the state of the joint."""
        if self._states is not None and self._last_state is not None and self._due(now):
            self._states.publish(self._last_state)

    def _limited(self, joint: str, value: float) -> float:
        limiter, name = self._ports.limiter, self.config.name
        match self.config.commanded:
            case "position":
                return limiter.position(name, joint, value)
            case "velocity":
                return limiter.velocity(name, joint, value)
        return value

    def _target(self, joint: str, set_point: float, state: RobotState, now: int, dt: float) -> JointTarget:
        reading, interface, limiter = state[joint], self.config.interface, self._ports.limiter
        pid = self._pids.get(joint)
        if pid is None:
            value = set_point
            if interface == "position":
                value = reading.position + limiter.error(joint, set_point, reading.position)
            return JointTarget(joint_name=joint, interface=interface, value=value)
        measured = reading.position if self.config.commanded == "position" else reading.velocity
        error = set_point - measured
        if self.config.commanded == "position":
            error = limiter.error(joint, set_point, measured)
        command = pid.step(error, dt if dt <= MAX_GAP_S else 0.0)
        if interface == "effort":
            command = limiter.effort(joint, command)
        self._last_state = _state(pid.params, set_point, measured, reading.velocity, error, dt, command, now)
        return JointTarget(joint_name=joint, interface=interface, value=command)


def _state(
    p: PidParameters, set_point: float, measured: float, rate: float, error: float, dt: float, command: float, now: int
) -> JointControllerState:
    return JointControllerState(
        header=Header(stamp=Time.of(now)),
        set_point=set_point,
        process_value=measured,
        process_value_dot=rate,
        error=error,
        time_step=dt,
        command=command,
        p=p.p,
        i=p.i,
        d=p.d,
        i_clamp=p.i_clamp_max,
        antiwindup=p.antiwindup,
    )
