"""The grader's measurements of each robot and of the run, as in measurements.json."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta


def _figure(text: str, unit: str) -> Meta:
    return Meta(ge=0, description=text, extra_json_schema={"unit": unit})


def _count(text: str) -> Meta:
    return Meta(ge=0, description=text)


def _signed(text: str, unit: str) -> Meta:
    return Meta(description=text, extra_json_schema={"unit": unit})


class CornerFigures(msgspec.Struct, frozen=True, kw_only=True):
    """A corner of a closed path, where the robot reported reaching it; positive heading errors are to the left.

    true: by ground truth; odometry: by the robot's own odometry, aligned with the world where the two first agreed.
    """

    at_s: Annotated[float, _figure("simulation time at which the robot reported it", "s")]
    true_m: Annotated[float, _figure("true distance from the corner", "m")]
    true_deg: Annotated[
        float, Meta(description="true heading minus the requested one", extra_json_schema={"unit": "deg"})
    ]
    odometry_m: Annotated[float, _figure("distance from the corner by odometry", "m")]
    odometry_deg: Annotated[
        float, Meta(description="heading by odometry minus the requested one", extra_json_schema={"unit": "deg"})
    ]


class RobotFigures(msgspec.Struct, frozen=True, kw_only=True, tag_field="kind", tag="base"):
    """One mobile robot, measured by ground truth in simulation time. null: there was nothing to measure."""

    points: Annotated[int, _count("points of the robot's last plan, all laps counted")]
    points_reached: Annotated[int, _count("points to which the robot truly came within the reach tolerance")]
    points_reached_at: Annotated[
        tuple[float | None, ...],
        Meta(description="when each point was reached", extra_json_schema={"unit": "s"}),
    ]
    points_closest_m: Annotated[
        tuple[float | None, ...],
        Meta(description="nearest true distance to each point while it was the goal", extra_json_schema={"unit": "m"}),
    ]
    cross_track_rms_m: (
        Annotated[float, _figure("root mean square over time of the distance to the reference path", "m")] | None
    )
    cross_track_max_m: Annotated[float, _figure("largest distance to the reference path", "m")] | None
    odometry_error_max_m: (
        Annotated[float, _figure("largest distance of odometry to ground truth, from a common start", "m")] | None
    )
    odometry_error_final_m: Annotated[float, _figure("that distance at the end", "m")] | None
    odometry_heading_error_max_deg: (
        Annotated[float, _figure("largest difference of the headings of odometry and ground truth", "deg")] | None
    )
    odometry_heading_error_final_deg: Annotated[float, _figure("that difference at the end", "deg")] | None
    corners: Annotated[
        tuple[CornerFigures | None, ...],
        Meta(description="corners of a closed path such as a square, in order; null where not reached"),
    ]
    closure_m: Annotated[float, _figure("true distance between the end of the closed path and its start", "m")] | None
    closure_heading_deg: Annotated[float, _figure("true difference of the headings there", "deg")] | None
    closure_odometry_m: Annotated[float, _figure("the same distance by odometry", "m")] | None
    closure_odometry_heading_deg: Annotated[float, _figure("the same difference by odometry", "deg")] | None
    stops: Annotated[int, _count("times that the base came to rest because no live command was left")]
    stop_speed: (
        Annotated[float, _figure("true speed at the last command before the longest of these stops", "m/s")] | None
    )
    stop_time_s: Annotated[float, _figure("time from that command to rest", "s")] | None
    stop_distance_m: Annotated[float, _figure("true distance travelled from that command to rest", "m")] | None
    stop_time_theory_s: Annotated[float, _figure("expected time: timeout + v / a", "s")] | None
    stop_distance_theory_m: Annotated[float, _figure("expected distance: v timeout + v^2 / 2a", "m")] | None
    path_length_m: Annotated[float, _figure("length of the true path over ground", "m")]
    time_s: Annotated[float, _figure("simulation time at which the robot had finished its plan", "s")] | None
    min_distance_m: (
        Annotated[float, _figure("smallest distance of its centre to another robot's at one instant", "m")] | None
    )
    min_clearance_m: (
        Annotated[
            float,
            _signed("smallest distance of the circle around the robot to a body of the world; below 0 within one", "m"),
        ]
        | None
    ) = None
    min_clearance_at_s: Annotated[float, _figure("simulation time of the smallest clearance", "s")] | None = None
    min_clearance_to: Annotated[str, Meta(description="the nearest body")] | None = None
    collisions: Annotated[int, _count("contacts with robots and obstacles, counted at their beginning")] | None
    commands_timed_out: Annotated[int, _count("times the base stopped because its command had grown too old")] | None
    stale_dropped: Annotated[int, _count("commands that were too old on arrival and not obeyed")] | None
    commands_refused: Annotated[int, _count("commands that were malformed or out of bounds")] | None
    messages_lost: Annotated[int, _count("messages of the robot's topics that a process of the fleet missed")]
    samples: Annotated[int, _count("ground-truth samples measured")]


class StepFigures(msgspec.Struct, frozen=True, kw_only=True):
    """A step of the set-point of an arm, from a value held for half a second to one at which it then stays."""

    at_s: Annotated[float, _figure("simulation time of the step", "s")]
    from_deg: Annotated[float, _signed("set-point before", "deg")]
    to_deg: Annotated[float, _signed("set-point after", "deg")]
    final_deg: Annotated[float, _signed("true final angle: the mean over the last half second", "deg")]
    rise_s: Annotated[float, _figure("time from 10 to 90 % of the way to the final angle", "s")]
    overshoot_percent: Annotated[float, _figure("largest angle beyond the final one, relative to the change", "%")]
    settling_s: Annotated[
        float, _figure("time from the step until it stays within 2 % of the change around the final angle", "s")
    ]
    steady_error_deg: Annotated[float, _figure("set-point less final angle, without sign", "deg")]


class ArmFigures(msgspec.Struct, frozen=True, kw_only=True, tag_field="kind", tag="arm"):
    """One arm, measured by its true angle in simulation time. null: there was nothing to measure."""

    steps: Annotated[tuple[StepFigures, ...], Meta(description="the steps of its set-point, in order")]
    step_final_deg: Annotated[float, _signed("of the largest step, see its entry in steps", "deg")] | None
    step_rise_s: Annotated[float, _figure("of the largest step", "s")] | None
    step_overshoot_percent: Annotated[float, _figure("of the largest step", "%")] | None
    step_settling_s: Annotated[float, _figure("of the largest step", "s")] | None
    step_steady_error_deg: Annotated[float, _figure("of the largest step", "deg")] | None
    tracking_rms_deg: (
        Annotated[
            float, _figure("root mean square of the error in motion, except the first second of each motion", "deg")
        ]
        | None
    )
    tracking_max_deg: Annotated[float, _figure("largest of these errors", "deg")] | None
    effort_max_nm: Annotated[float, _figure("largest effort that the controller requested", "N m")] | None
    effort_rms_nm: Annotated[float, _figure("root mean square of the effort", "N m")] | None
    saturated_s: Annotated[float, _figure("time at the largest permitted effort", "s")]
    saturated_share: Annotated[float, _figure("its share of the time under control", "1")]
    control_gap_s: Annotated[float, _figure("longest time between two ticks of the controller", "s")] | None
    time_s: (
        Annotated[float, _figure("simulation time at which it had finished: set-point and arm had rested for 1 s", "s")]
        | None
    )
    messages_lost: Annotated[int, _count("messages of the arm's topics that a process of the fleet missed")]
    samples: Annotated[int, _count("joint states measured")]


Figures = RobotFigures | ArmFigures
"""The measurements of one robot; ``kind`` is the tag."""

EndReason = Literal["goals", "duration", "stopped"]


class Measurements(msgspec.Struct, frozen=True, kw_only=True):
    """The whole run. ``ended``: all robots finished, the duration elapsed, or the grader was stopped earlier."""

    ended: EndReason
    sim_seconds: float
    trajectory_hash: str
    messages_lost: int
    onlookers_lost: dict[str, int]
    members_lost: tuple[str, ...] | None = None
    """Nodes without which lockstep continued; None without lockstep."""
    members_left: tuple[str, ...] = ()
    """Nodes that left lockstep properly before the end."""
    robots: dict[str, Figures]
    ticks_missed: dict[str, int] = {}
    losses: dict[str, dict[str, int]] = {}
    """``messages_lost`` by node and topic, as far as the heartbeats of nodes with very many topics tell."""


MEASUREMENTS_FILE = "measurements.json"
TRAJECTORIES_FILE = "trajectories.npz"

ROBOT_TRAIL_COLUMNS = ("time", "x", "y", "yaw", "odom_x", "odom_y", "cross_track", "speed")
"""Columns of ``<robot>.trail`` in the trajectories: s, m, m, rad, m, m, m, m/s; nan if unknown. The reference path is
``<robot>.path``, x and y in m. The bodies of the world are in WORLD_ARRAYS."""

WORLD_ARRAYS = tuple(f"world.{each}" for each in ("corners", "counts", "bodies", "colours", "paths", "path_counts"))
"""The bodies of the world in the trajectories: the corners of all outlines from above at the start, x and y in m; the
number of corners of each outline, and the index of its body; the colour of each body (red, green, blue and opacity, 0
to 1); the points through which the bodies moved, one body after the other; and their number per body, 0 for one at
rest."""

ARM_TRAIL_COLUMNS = ("time", "reference", "angle", "error", "effort")
"""Columns of ``<robot>.trail`` of an arm: s, deg, deg, deg, N m; it ends when the arm has finished."""
