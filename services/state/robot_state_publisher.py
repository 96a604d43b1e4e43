"""One robot of the state service: its description, joint states and transforms."""

from __future__ import annotations

from collections.abc import Iterable

from messages.geometry import TransformStamped
from messages.sensor import JointState
from messages.std import String
from messages.topics import JOINT_STATES, ROBOT_DESCRIPTION
from models.urdf import BadUrdf, parse_urdf
from services.runtime.context import Context
from services.runtime.errors import BadInput
from services.state import StateParameters
from services.state.joint_state_merger import JointStateMerger
from services.state.link_transforms import LinkTransforms


class RobotStatePublisher:
    """The robot in a namespace. Nothing is published until it has a valid description."""

    def __init__(self, ctx: Context[StateParameters], namespace: str, urdf: str) -> None:
        self._ctx, self._namespace, self._urdf = ctx, namespace.strip("/"), urdf
        self.links: LinkTransforms | None = None
        self.rejected = 0
        p = ctx.params
        self.prefix = p.frame_prefix if p.frame_prefix is not None else f"{self._namespace}/".removeprefix("/")
        self._merges = bool(p.source_list) or p.publish_default_positions
        self._merger: JointStateMerger | None = None
        self._next_merge = 0
        if urdf:
            ctx.advertise(ROBOT_DESCRIPTION.named(self._name(ROBOT_DESCRIPTION.name))).publish(String(data=urdf))
            self.set_description(urdf)
        else:
            self._description = ctx.stream(ROBOT_DESCRIPTION.named(self._name(ROBOT_DESCRIPTION.name)))
        if self._merges:
            self._publisher = ctx.advertise(JOINT_STATES.named(self._name(JOINT_STATES.name)))
            if self._publisher.name in [ctx.node.identity.resolve(self._name(each)) for each in p.source_list]:
                raise BadInput(f"state: source_list holds {self._publisher.name}, which is its own output")
            self._sources = [ctx.stream(JOINT_STATES.named(self._name(each))) for each in p.source_list]
        else:
            self._sources = [ctx.stream(JOINT_STATES.named(self._name(JOINT_STATES.name)))]

    @property
    def label(self) -> str:
        """Name of the robot, for the log."""
        return f"/{self._namespace}"

    def set_description(self, urdf: str) -> None:
        """Set the description; raises BadUrdf, and keeps the previous one then."""
        p, description = self._ctx.params, parse_urdf(urdf)
        merger = JointStateMerger(description, p) if self._merges else None
        self.links = LinkTransforms(description, self.prefix, round(1e9 / p.publish_frequency), p.ignore_timestamp)
        self._merger = merger
        kinds = [each.kind for each in description.joints]
        self._ctx.log.info(
            f"{self.label}: {description.name or 'a robot'} with {kinds.count('fixed')} fixed and "
            f"{sum(each.single_dof for each in description.joints)} moving joints; root frame "
            f"{self.prefix}{description.root}"
        )
        for remark in description.warnings:
            self._ctx.log.warn(f"{self.label}: {remark}")
        if odd := [each.name for each in description.joints if each.kind in ("floating", "planar")]:
            self._ctx.log.warn(
                f"{self.label}: joints {', '.join(odd)} have no joint state, so the poses of their links are unknown"
            )

    def update_description(self) -> bool:
        """Read the topic of the description; return whether it changed."""
        changed = False
        for text in [] if self._urdf else self._description.drain():
            try:
                self.set_description(text.data)
                changed = True
            except BadUrdf as error:
                self._reject(f"its robot_description is refused: {error}")
        return changed

    def reset(self) -> None:
        """Handle a reset of time."""
        self._next_merge = 0
        if self.links is not None:
            self.links.reset()

    def transforms(self, now: int) -> Iterable[TransformStamped]:
        """Return the transforms of the joint states received; also publish merged joint states."""
        links = self.links
        if links is None:
            return
        for state in self._states(now):
            moving = links.moving_transforms(state, now)
            if moving.warning:
                self._ctx.log.warn(f"{self.label}: {moving.warning}", every=10.0)
            yield from moving.transforms
        self.rejected += links.rejected
        links.rejected = 0

    def _states(self, now: int) -> list[JointState]:
        """Return the joint states to publish: those received, or the merged one if it is due."""
        came = [state for source in self._sources for state in source.drain()]
        if self._merger is None:
            return came
        for state in came:
            self._merger.add(state)
        if now < self._next_merge:
            return []
        period = round(1e9 / self._ctx.params.rate)
        self._next_merge = now - now % period + period
        merged = self._merger.merged(now)
        self._merger.step_defaults()
        if merged is None:
            return []
        self._publisher.publish(merged)
        return [merged]

    def _name(self, topic: str) -> str:
        """Return the name of a topic of this robot; a name with a leading slash is unchanged."""
        return topic if topic.startswith("/") else f"/{self._namespace}/{topic}".replace("//", "/")

    def _reject(self, text: str) -> None:
        self.rejected += 1
        self._ctx.log.error(f"{self.label}: {text}")
