"""The trajectory controller: follows trajectories of several joints, from a topic or as action goals."""

from __future__ import annotations

from messages.actionlib import Status
from messages.control import (
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryGoal,
    JointTrajectoryControllerState,
    TrajectoryError,
)
from messages.joints import JointTarget
from messages.std import Duration, Header, Time
from messages.topics import Quality, Topic
from messages.trajectory import JointTrajectory, JointTrajectoryPoint
from services.controller_manager.config import ROS_2_TRAJECTORY, ControllerConfig
from services.controller_manager.controller import MAX_GAP_S, Due, Ports, RobotState
from services.controller_manager.follow_joint_trajectory import MAX_TRAJECTORY_BYTES, FollowJointTrajectoryServer
from services.controller_manager.joint_pid import JointPid, PidParameters
from services.controller_manager.trajectory import (
    Sampled,
    Trajectory,
    Values,
    default_tolerances,
    goal_tolerances,
    hold,
    violation,
)
from services.controller_manager.trajectory_message import BadTrajectory, plan
from services.runtime.errors import BadInput


class TrajectoryController:
    """Follows one trajectory at a time; a newer one replaces it from its own start time on.

    When it starts, after an abandoned trajectory, and at the end of one, it holds the joints where they are.
    """

    def __init__(self, config: ControllerConfig, ports: Ports) -> None:
        assert config.trajectory is not None
        self.config, self._settings, self._ports = config, config.trajectory, ports
        name = config.name
        self._commands = [
            ports.stream(
                Topic(
                    f"{name}/{each}",
                    JointTrajectory,
                    0,
                    Quality.EVENT,
                    "trajectory of the joints",
                    MAX_TRAJECTORY_BYTES,
                )
            )
            for each in ("command", "joint_trajectory")
        ]
        names = ("state", "controller_state") if config.type == ROS_2_TRAJECTORY else ("state",)
        self._states = [
            ports.advertise(
                Topic(
                    f"{name}/{each}",
                    JointTrajectoryControllerState,
                    self._settings.state_publish_rate,
                    Quality.SENSOR,
                    "desired and actual state of the joints",
                )
            )
            for each in names
        ]
        self._server = FollowJointTrajectoryServer(name, self._settings.action_monitor_rate, ports)
        self._pids = {
            joint: JointPid(ports.announce(config.gain_set(joint), PidParameters.of(gains)))
            for joint, gains in config.gains.items()
        }
        self._state_due = Due(self._settings.state_publish_rate)
        self._own_tolerances = default_tolerances(config.joints, self._settings)
        self._tolerances = self._own_tolerances
        self._trajectory: Trajectory | None = None
        self._actual: Values = ()
        self._last_feedback: FollowJointTrajectoryFeedback | None = None

    def read(self, now: int, refusal: str) -> None:
        """Process the received cancellations, then goals, then trajectories from topics, each in order of arrival."""
        for goal in self._server.cancelled(now):
            if goal == self._server.active:
                self._server.end(Status.PREEMPTED, now, "cancelled on request")
                self._hold(now)
        for goal_id, message in self._server.received(now):
            self._handle_goal(goal_id.id, message.goal, now, refusal)
        for stream in self._commands:
            for trajectory in stream.drain():
                self._handle_command(trajectory, now, refusal)

    def start(self, state: RobotState, now: int) -> None:
        """Hold the joints where they are."""
        self._actual = tuple(state[joint].position for joint in self.config.joints)
        self._hold(now)
        for pid in self._pids.values():
            pid.reset()

    def halt(self, reason: str, now: int) -> None:
        """Abort the active goal and trajectory."""
        self._server.end(Status.ABORTED, now, reason, TrajectoryError.INVALID_GOAL)
        self._trajectory, self._last_feedback = None, None

    def update(self, state: RobotState, now: int, dt: float) -> list[JointTarget]:
        """Return the targets of the joints, after checking the goal's tolerances against their positions."""
        if self._trajectory is None:
            return []
        joints, limiter = self.config.joints, self._ports.limiter
        self._actual = tuple(state[joint].position for joint in joints)
        rates = tuple(state[joint].velocity for joint in joints)
        desired = self._trajectory.at(now)
        errors, rate_errors = self._errors(desired), _rate_errors(desired, rates)
        if self._server.active and self._check_goal(errors, rate_errors, now):
            desired = self._trajectory.at(now)
            errors, rate_errors = self._errors(desired), _rate_errors(desired, rates)
        self._last_feedback = self._feedback(desired, rates, errors, rate_errors, now)
        targets = []
        for index, joint in enumerate(joints):
            error, rate = errors[index], desired.velocities[index]
            if (pid := self._pids.get(joint)) is not None:
                command = pid.params.ff_velocity_scale * rate
                command += pid.step(error, dt if dt <= MAX_GAP_S else 0.0, rate_errors[index])
                if self.config.interface == "effort":
                    command = limiter.effort(joint, command)
                targets.append(JointTarget(joint_name=joint, interface=self.config.interface, value=command))
                continue
            goal = limiter.position(self.config.name, joint, desired.positions[index])
            if goal != desired.positions[index]:
                rate = 0.0
            goal = self._actual[index] + limiter.error(joint, goal, self._actual[index])
            targets.append(JointTarget(joint_name=joint, interface="position", value=goal, rate=rate))
        return targets

    def publish(self, now: int) -> None:
        """Publish the state, and the status and feedback of the goal."""
        if self._last_feedback is not None and self._state_due(now):
            feedback = self._last_feedback
            state = JointTrajectoryControllerState(
                header=feedback.header,
                joint_names=feedback.joint_names,
                desired=feedback.desired,
                actual=feedback.actual,
                error=feedback.error,
            )
            for publisher in self._states:
                publisher.publish(state)
        self._server.publish(now, self._last_feedback)

    def _handle_goal(self, goal: str, goal_message: FollowJointTrajectoryGoal, now: int, refusal: str) -> None:
        if refusal or self._trajectory is None:
            text = refusal or "the controller has not started yet"
            self._server.reject(goal, now, TrajectoryError.INVALID_GOAL, text)
            return
        try:
            tolerances = goal_tolerances(goal_message, self._own_tolerances, self.config.joints)
            planned = self._plan(goal_message.trajectory, now, goal)
        except BadTrajectory as error:
            self._refuse_goal(goal, now, error.code, str(error))
        except BadInput as error:
            self._refuse_goal(goal, now, TrajectoryError.INVALID_JOINTS, str(error))
        else:
            self._server.accept(goal, now)
            self._trajectory, self._tolerances = planned, tolerances

    def _refuse_goal(self, goal: str, now: int, code: TrajectoryError, text: str) -> None:
        self._ports.warn(f"{self.config.name}: a goal is rejected: {text}")
        self._server.reject(goal, now, code, text)

    def _handle_command(self, message: JointTrajectory, now: int, refusal: str) -> None:
        try:
            if refusal or self._trajectory is None:
                raise BadInput(refusal or "the controller has not started yet")
            planned = self._plan(message, now) if message.points else None
        except BadInput as error:
            self._ports.warn(f"{self.config.name}: a trajectory is refused: {error}")
            return
        self._server.end(Status.PREEMPTED, now, "preempted by a newer trajectory")
        if planned is None:
            self._hold(now)
        else:
            self._trajectory = planned

    def _plan(self, message: JointTrajectory, now: int, goal: str = "") -> Trajectory:
        assert self._trajectory is not None
        joints = self.config.joints
        continuous = [joint for joint in joints if self._ports.limiter.is_continuous(joint)]
        return plan(message, joints, continuous, self._settings, self._trajectory, now, goal)

    def _errors(self, desired: Sampled) -> Values:
        limiter = self._ports.limiter
        return tuple(
            limiter.error(joint, one, other)
            for joint, one, other in zip(self.config.joints, desired.positions, self._actual, strict=True)
        )

    def _check_goal(self, errors: Values, rate_errors: Values, now: int) -> bool:
        """End the active goal if it is reached or violated; return whether its trajectory was aborted."""
        trajectory, joints, server = self._trajectory, self.config.joints, self._server
        assert trajectory is not None
        if now < trajectory.end:
            # Until a later goal starts, the earlier trajectory is followed, and no tolerances are checked.
            if trajectory.segment(now).goal != server.active:
                return False
            if not (why := violation(self._tolerances.path, joints, errors, rate_errors)):
                return False
            code = TrajectoryError.PATH_TOLERANCE_VIOLATED
        else:
            if not (why := violation(self._tolerances.goal, joints, errors, rate_errors)):
                server.end(Status.SUCCEEDED, now, "goal reached")
                return False
            limit = self._tolerances.goal_time
            if limit is None or now < trajectory.end + limit * 1e9:
                return False
            code = TrajectoryError.GOAL_TOLERANCE_VIOLATED
            why += f", {(now - trajectory.end) / 1e9:.2f} s after the end"
        self._ports.warn(f"{self.config.name}: a goal is aborted: {why}")
        server.end(Status.ABORTED, now, why, code)
        self._hold(now)
        return True

    def _hold(self, now: int) -> None:
        """Hold the joints where they are."""
        if self._actual:
            self._trajectory = hold(self._actual, now)

    def _feedback(
        self, desired: Sampled, rates: Values, errors: Values, rate_errors: Values, now: int
    ) -> FollowJointTrajectoryFeedback:
        assert self._trajectory is not None
        since = Duration.of(now - self._trajectory.segments[0].start)
        return FollowJointTrajectoryFeedback(
            header=Header(stamp=Time.of(now)),
            joint_names=self.config.joints,
            desired=JointTrajectoryPoint(
                positions=desired.positions,
                velocities=desired.velocities,
                accelerations=desired.accelerations,
                time_from_start=since,
            ),
            actual=JointTrajectoryPoint(positions=self._actual, velocities=rates, time_from_start=since),
            error=JointTrajectoryPoint(positions=errors, velocities=rate_errors, time_from_start=since),
        )


def _rate_errors(desired: Sampled, rates: Values) -> Values:
    return tuple(one - other for one, other in zip(desired.velocities, rates, strict=True))
