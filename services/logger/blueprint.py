"""The initial layout of a recording: the world, beside it the fleet's plots and each robot's own, below it the log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet

import rerun as rr
import rerun.blueprint as rrb

from services.logger import entity_paths
from services.logger.entity_paths import (
    COMMANDED,
    CROSS_TRACK,
    DISTANCE,
    LOG,
    ODOMETRY_ERROR,
    SPEED,
    collisions,
    odometry_trail,
    trail,
)

Extent = tuple[float, float, float, float]

MAX_ARM_PLOTS = 2
"""Maximum number of arms with a plot on the fleet's page; each arm also has a page of its own."""

MAX_PAGES = 12
"""Maximum number of robots with a page of plots of their own; the fleet's page and the entity tree contain all."""

BACKGROUND = (18, 20, 24)


def blueprint(
    robots: Sequence[tuple[str, str]],
    arms: AbstractSet[str],
    extent: Extent,
    timelines: Sequence[str],
    images: Mapping[str, str] | None = None,
) -> rrb.Blueprint:
    """Return the layout for robots as (name, name of the URDF's robot), including ``arms``, on the last of
    ``timelines``.

    ``extent`` [m] is the ground in the initial view: x and y of one corner, then of the opposite one. ``images`` maps
    image topics to entities.
    """
    names = [name for name, _ in robots]
    driving = [name for name in names if name not in arms]
    own = [
        _arm(name) if name in arms else _robot(name, [each == name for each in driving]) for name in names[:MAX_PAGES]
    ]
    pictures = [rrb.Spatial2DView(origin=entity, name=topic) for topic, entity in (images or {}).items()]
    plots = [_fleet([name for name in names if name in arms]), *own] if driving or not names else own
    log = rrb.TextLogView(
        origin=LOG,
        name="Log",
        columns=rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"]),
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            _world(robots, extent, timelines),
            rrb.Vertical(rrb.Tabs(*pictures, *plots, active_tab=0, name="plots"), log, row_shares=[9, 2]),
            column_shares=[11, 9],
        ),
        rrb.TimePanel(timeline=timelines[-1], state="collapsed", play_state="following"),
        collapse_panels=True,
    )


def _world(robots: Sequence[tuple[str, str]], extent: Extent, timelines: Sequence[str]) -> rrb.Spatial3DView:
    past = [
        rrb.VisibleTimeRange(
            timeline,
            start=rrb.TimeRangeBoundary.infinite(),
            end=rrb.TimeRangeBoundary.cursor_relative(),
        )
        for timeline in timelines
    ]
    return rrb.Spatial3DView(
        origin="/",
        name="World",
        contents=["+ /**", "- /images/**", *(f"- {collisions(name, model)}/**" for name, model in robots)],
        spatial_information=rrb.SpatialInformation(target_frame="world"),
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(spacing=0.5, stroke_width=0.75, color=(90, 96, 106, 110)),
        eye_controls=_eye(extent),
        defaults=[shape.from_fields(fill_mode="solid") for shape in (rr.Boxes3D, rr.Cylinders3D, rr.Ellipsoids3D)],
        overrides={each(name): rrb.VisibleTimeRanges(past) for name, _ in robots for each in (trail, odometry_trail)},
    )


def _eye(extent: Extent) -> rrb.EyeControls3D:
    """Return the eye south of the extent and above it, far enough to see all of it, with x to the right."""
    x, y = (extent[0] + extent[2]) / 2, (extent[1] + extent[3]) / 2
    size = max(abs(extent[2] - extent[0]), abs(extent[3] - extent[1]), 1.0)
    return rrb.EyeControls3D(
        position=(x, y - 0.65 * size, 0.86 * size),
        look_target=(x, y - 0.03 * size, 0.0),
        eye_up=(0.0, 0.0, 1.0),
    )


def _fleet(arms: Sequence[str]) -> rrb.Vertical:
    return rrb.Vertical(
        _plot("Speed [m/s], in the colours of the trails", SPEED),
        _plot("Cross-track error [m]", CROSS_TRACK),
        _plot("Odometry against ground truth [m]", ODOMETRY_ERROR),
        *(
            _plot(f"{name}: angle, and reference (darker) [deg]", entity_paths.angle(name))
            for name in arms[:MAX_ARM_PLOTS]
        ),
        *([] if arms else [_plot("Distance to the goal [m]", DISTANCE)]),
        name="fleet",
    )


def _robot(name: str, only: list[bool]) -> rrb.Vertical:
    return rrb.Vertical(
        _plot("Speed, and commanded speed (darker) [m/s]", COMMANDED, SPEED, only=only),
        _plot("Cross-track error [m]", CROSS_TRACK, only=only),
        _plot("Odometry against ground truth [m]", ODOMETRY_ERROR, only=only),
        _plot("Distance to the goal [m]", DISTANCE, only=only),
        name=name,
    )


def _arm(name: str) -> rrb.Vertical:
    return rrb.Vertical(
        _plot("Angle, and reference (darker) [deg]", entity_paths.angle(name)),
        _plot("Error [deg]", entity_paths.error(name)),
        _plot("Effort [N m]", entity_paths.effort(name)),
        name=name,
    )


def _plot(name: str, *entities: str, only: Sequence[bool] | None = None) -> rrb.TimeSeriesView:
    """Return a plot of the whole run, of every robot or of the ``only`` one, in the colours of the trails."""
    lines = {} if only is None else {each: rr.SeriesLines.from_fields(visible_series=only) for each in entities}
    always = rrb.TimeRangeBoundary.infinite()
    return rrb.TimeSeriesView(
        origin="/",
        name=name,
        contents=[f"+ {each}" for each in entities],
        overrides={each: style.visualizer() for each, style in lines.items()},
        axis_x=rrb.TimeAxis(view_range=rrb.TimeRange(start=always, end=always)),
        plot_legend=rrb.PlotLegend(visible=False),
    )
