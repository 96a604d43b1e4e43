"""Merges joint states of several sources, with the rules of ROS's joint_state_publisher (noetic-devel)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from messages.base import LARGEST
from messages.sensor import JointState
from messages.std import Header, Time
from models.urdf import BadUrdf, Joint, Mimic, RobotDescription
from services.state import StateParameters

_NUMBER = r"[0-9]*\.?[0-9]+(?:[eE][+-]?[0-9]+)?"
_DEPENDENT = re.compile(rf"([^=*\s]+)=([^=*+\s]+?)(?:\*([+-]?{_NUMBER}))?([+-]{_NUMBER})?")


class FreeJoint:
    """State of one independent joint; None if no source has it. ``forward`` is the direction of ``delta``."""

    def __init__(self, low: float, high: float, continuous: bool) -> None:
        self.low, self.high, self.continuous = low, high, continuous
        self.position: float | None = None
        self.velocity: float | None = None
        self.effort: float | None = None
        self.reported = False
        self.forward = True


class JointStateMerger:
    """Merges the joints of a robot. Raises BadUrdf for zeros or dependencies that its joints do not allow."""

    def __init__(self, description: RobotDescription, params: StateParameters) -> None:
        self._params = params
        joints = [each for each in description.joints if each.single_dof]
        self._names = tuple(each.name for each in joints)
        self._dependencies = _dependencies(joints, params)
        zeros = dict(_parse_zero(each, self._names) for each in params.zeros)
        self._free: dict[str, FreeJoint] = {}
        for each in joints:
            if each.name in self._dependencies:
                if each.name in zeros:
                    raise BadUrdf(f"zeros: joint {each.name!r} follows {self._dependencies[each.name].joint!r}")
                continue
            joint = self._free[each.name] = FreeJoint(*joint_limits(each, params.use_smallest_joint_limits))
            zero = zeros.get(each.name)
            if zero is not None and not joint.low <= zero <= joint.high:
                raise BadUrdf(f"zeros: {each.name} = {zero:g} is outside {joint.low:g} to {joint.high:g}")
            self._set_defaults(joint, zero)

    def add(self, state: JointState) -> None:
        """Merge a joint state; the newest value of a joint counts, unknown names are ignored."""
        for index, name in enumerate(state.name):
            if (joint := self._free.get(name)) is None:
                continue
            joint.reported = True
            if state.position:
                joint.position = state.position[index]
            if state.velocity:
                joint.velocity = state.velocity[index]
            if state.effort:
                joint.effort = state.effort[index]

    def merged(self, now: int) -> JointState | None:
        """Return the merged joint state at ``now`` [ns]; None while no position is known.

        Joints without a known position are omitted. Velocities are included if all these joints have one, or 0 if the
        parameters ask for it; likewise efforts.
        """
        rows = [row for name in self._names if (row := self._row(name)) is not None]
        if not rows:
            return None
        names, positions, velocities, efforts = zip(*rows, strict=True)
        return JointState(
            header=Header(stamp=Time.of(now)),
            name=names,
            position=positions,
            velocity=velocities if None not in velocities else (),
            effort=efforts if None not in efforts else (),
        )

    def step_defaults(self) -> None:
        """Move the joints without a source by ``delta``, back and forth between their limits."""
        step = self._params.delta
        for joint in self._free.values():
            if joint.reported or joint.position is None or not step:
                continue
            joint.position += step if joint.forward else -step
            if joint.continuous:
                joint.position = math.remainder(joint.position, math.tau)
            elif not joint.low < joint.position < joint.high:
                joint.position = min(max(joint.position, joint.low), joint.high)
                joint.forward = not joint.forward

    def _set_defaults(self, joint: FreeJoint, zero: float | None) -> None:
        p = self._params
        if p.publish_default_positions:
            middle = (joint.low + joint.high) / 2 if joint.low > 0 or joint.high < 0 else 0.0
            joint.position = middle if zero is None else zero
        joint.velocity = 0.0 if p.publish_default_velocities else None
        joint.effort = 0.0 if p.publish_default_efforts else None

    def _row(self, name: str) -> tuple[str, float, float | None, float | None] | None:
        """Return name, position, velocity and effort of a joint, through the joints that it follows."""
        factor, offset, source = 1.0, 0.0, name
        while (mimic := self._dependencies.get(source)) is not None:
            offset, factor, source = offset + factor * mimic.offset, factor * mimic.factor, mimic.joint
        joint = self._free[source]
        if joint.position is None:
            return None
        position = factor * joint.position + offset
        velocity = None if joint.velocity is None else factor * joint.velocity
        if not abs(position) <= LARGEST or not abs(velocity or 0.0) <= LARGEST:
            return None
        return name, position, velocity, joint.effort


def joint_limits(joint: Joint, smallest: bool) -> tuple[float, float, bool]:
    """Return the limits [rad or m] of a joint (the safety controller's if narrower), and whether it is continuous."""
    if joint.kind == "continuous":
        return -math.pi, math.pi, True
    assert joint.limits.lower is not None
    assert joint.limits.upper is not None
    low, high = joint.limits.lower, joint.limits.upper
    if smallest:
        low = low if joint.limits.soft_lower is None else max(low, joint.limits.soft_lower)
        high = high if joint.limits.soft_upper is None else min(high, joint.limits.soft_upper)
    if low > high:
        raise BadUrdf(f"joint {joint.name!r}: its soft limits leave no room, {low:g} is above {high:g}")
    return low, high, False


def _parse_zero(text: str, names: Iterable[str]) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        zero = float(value)
    except ValueError:
        zero = math.nan
    if not math.isfinite(zero):
        raise BadUrdf(f"zeros: {text!r} is not joint=number, e.g. elbow=0.5")
    return _check_joint(name, names, "zeros"), zero


def _dependencies(joints: list[Joint], params: StateParameters) -> dict[str, Mimic]:
    """Return the dependent joints with their sources, from parameters and URDF; raises BadUrdf for a loop."""
    names = [each.name for each in joints]
    found = {each.name: each.mimic for each in joints if each.mimic and params.use_mimic_tags}
    for text in params.dependent_joints:
        parts = _DEPENDENT.fullmatch(text.replace(" ", ""))
        if parts is None:
            raise BadUrdf(f"dependent_joints: {text!r} is not joint=other, joint=other*factor+offset")
        name, other, factor, offset = parts.groups()
        _check_joint(name, names, "dependent_joints")
        _check_joint(other, names, "dependent_joints")
        found[name] = Mimic(other, float(factor or 1), float(offset or 0))
    for first in found:
        name, seen = first, {first}
        while (mimic := found.get(name)) is not None:
            name = mimic.joint
            if name in seen:
                raise BadUrdf(f"joints follow each other in a loop, e.g. {name!r}")
            seen.add(name)
    return found


def _check_joint(name: str, names: Iterable[str], where: str) -> str:
    if name not in names:
        raise BadUrdf(f"{where}: the robot has no joint {name!r} that moves (known: {', '.join(names)})")
    return name
