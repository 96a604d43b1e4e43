"""What the grader measures: the record of one robot and of the whole run, as measurements.json holds them."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta


def _figure(text: str, unit: str) -> Meta:
    return Meta(ge=0, description=text, extra_json_schema={"unit": unit})


def _count(text: str) -> Meta:
    return Meta(ge=0, description=text)


class CornerFigures(msgspec.Struct, frozen=True, kw_only=True):
    """A corner of a closed way, where the robot said that it had reached it; headings are off to the left if positive.

    true: on ground truth; odometry: by the robot's own odometry, placed in the world where the two first agreed.
    """

    at_s: Annotated[float, _figure("simulation time at which the robot said so", "s")]
    true_m: Annotated[float, _figure("true distance from the corner", "m")]
    true_deg: Annotated[
        float, Meta(description="true heading less the one asked for", extra_json_schema={"unit": "deg"})
    ]
    odometry_m: Annotated[float, _figure("distance from the corner by odometry", "m")]
    odometry_deg: Annotated[
        float, Meta(description="heading by odometry less the one asked for", extra_json_schema={"unit": "deg"})
    ]


class RobotFigures(msgspec.Struct, frozen=True, kw_only=True):
    """One robot, measured on ground truth in simulation time. null: there was nothing to measure."""

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
        Annotated[float, _figure("root mean square over time of the distance to the two legs at the last point", "m")]
        | None
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
        Meta(description="corners of a closed way, as a square is, in order; null where not reached"),
    ]
    closure_m: Annotated[float, _figure("true distance of the end of the closed way from its beginning", "m")] | None
    closure_heading_deg: Annotated[float, _figure("true difference of the headings there", "deg")] | None
    closure_odometry_m: Annotated[float, _figure("the same distance by odometry", "m")] | None
    closure_odometry_heading_deg: Annotated[float, _figure("the same difference by odometry", "deg")] | None
    stops: Annotated[int, _count("times that the base came to rest because no live command was left")]
    stop_speed: (
        Annotated[float, _figure("true speed at the last command before the longest of these stops", "m/s")] | None
    )
    stop_time_s: Annotated[float, _figure("time from that command to rest", "s")] | None
    stop_distance_m: Annotated[float, _figure("true way from that command to rest", "m")] | None
    stop_time_theory_s: Annotated[float, _figure("what the time should be: timeout + v / a", "s")] | None
    stop_distance_theory_m: Annotated[float, _figure("what the way should be: v timeout + v^2 / 2a", "m")] | None
    path_length_m: Annotated[float, _figure("length of the true path over ground", "m")]
    time_s: Annotated[float, _figure("simulation time at which the robot had finished its plan", "s")] | None
    min_distance_m: (
        Annotated[float, _figure("smallest distance of its centre to another robot's at one instant", "m")] | None
    )
    collisions: Annotated[int, _count("contacts with robots and obstacles, counted at their beginning")]
    commands_timed_out: Annotated[int, _count("times the base stopped because its command had grown too old")]
    stale_dropped: Annotated[int, _count("commands that were too old on arrival and not obeyed")]
    commands_refused: Annotated[int, _count("commands that were malformed or out of bounds")]
    messages_lost: Annotated[int, _count("messages of the robot's topics that a reader missed")]
    samples: Annotated[int, _count("ground-truth samples measured")]


Ended = Literal["goals", "duration", "stopped"]


class Measurements(msgspec.Struct, frozen=True, kw_only=True):
    """The whole run. ``ended``: all robots finished, the duration was over, or the grader was stopped before."""

    ended: Ended
    sim_seconds: float
    trajectory_hash: str
    messages_lost: int
    robots: dict[str, RobotFigures]


MEASUREMENTS_FILE = "measurements.json"
TRAJECTORIES_FILE = "trajectories.npz"

TRAIL_COLUMNS = ("time", "x", "y", "yaw", "odom_x", "odom_y", "cross_track", "speed")
"""Columns of ``<robot>.trail`` in the trajectories: s, m, m, rad, m, m, m, m/s; nan where unknown. The reference path
is ``<robot>.path``, x and y in m."""
