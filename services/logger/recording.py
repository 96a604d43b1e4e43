"""A recording in the making: bodies and styles once, then batches of columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from messages.rosgraph import DEBUG, ERROR, FATAL, INFO, WARN, Log
from models.palette import colours
from services.logger import paths
from services.logger.batch import Batch
from services.logger.blueprint import Extent, blueprint
from services.logger.body import Body
from services.logger.palette import dimmed
from services.logger.sinks import PATIENCE_S, open_sinks
from services.logger.table import Table

APPLICATION = "elea"

LEVELS = {DEBUG: "DEBUG", INFO: "INFO", WARN: "WARN", ERROR: "ERROR", FATAL: "CRITICAL"}

REFERENCE_WIDTH = -0.7
"""Radius of a reference path; rerun reads a negative one as points on the screen instead of metres."""

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


class Recording:
    """Writes ``file``, and serves viewers on ``port`` of 127.0.0.1 unless that is None; ``with`` opens and closes it.

    ``robots`` are (name, model). A live view that cannot be had is told to ``warn`` and costs nothing else.
    ``with`` raises BadInput for a file that cannot be written or a model that does not exist.
    """

    def __init__(
        self,
        file: Path,
        robots: Sequence[tuple[str, str]],
        extent: Extent,
        warn: Callable[[str], None],
        port: int | None = None,
        memory_mib: int = 256,
        footer: bool = True,
    ) -> None:
        self.file, self.url = file, ""
        self._robots, self._extent, self._warn = robots, extent, warn
        self._port, self._memory_mib, self._footer = port, memory_mib, footer
        self._resets = 0
        self._begun = False

    def __enter__(self) -> Self:
        colour = colours(name for name, _ in self._robots)
        bodies = [Body(name, model, colour[name]) for name, model in self._robots]
        self._bodies = {body.name: body for body in bodies}
        self._new_tables()
        self._stream = rr.RecordingStream(APPLICATION)
        self.url, trouble = open_sinks(
            self._stream, self.file, self._footer, self._port, self._memory_mib, self._layout()
        )
        if trouble:
            self._warn(f"{trouble}; the recording goes on in {self.file}")
        self._stream.log("/", rr.CoordinateFrame("world"), rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for body in bodies:
            body.log_to(self._stream)
        self._log_styles()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.commit()
        self._stream.disconnect()

    def commit(self) -> None:
        """Block until what was written is in the file: a killed process loses none of it, and nothing piles up."""
        try:
            self._stream.flush(timeout_sec=PATIENCE_S)
        except (RuntimeError, ValueError) as failure:
            self._warn(f"a part of the recording {self.file} may be missing: {failure}")

    def restart(self) -> None:
        """Begin a new timeline: after a reset, simulation time starts again."""
        if self._begun:
            self._resets, self._begun = self._resets + 1, False
            self._new_tables()
            self._stream.send_blueprint(self._layout())

    def write(self, batches: Mapping[str, Batch], last: bool = False) -> None:
        """Append the robots' batches; plots wait for the slowest robot, unless it is the ``last`` time."""
        for body in self._bodies.values():
            if (batch := batches.get(body.name)) is not None:
                self._write_body(body, batch)
        for index, body in enumerate(self._driving):
            if (batch := batches.get(body.name)) is not None:
                self._gauges.add(index, batch.times, batch.gauges)
                self._odometry.add(index, batch.odometry_times, batch.odometry_error)
        times, gauges = self._gauges.take(last)
        for number, plot in enumerate((paths.SPEED, paths.COMMANDED, paths.CROSS_TRACK, paths.DISTANCE)):
            self._plot(plot, times, gauges[:, :, number])
        times, error = self._odometry.take(last)
        self._plot(paths.ODOMETRY_ERROR, times, error[:, :, 0])

    def write_log(self, lines: Sequence[Log]) -> None:
        """Append lines of the nodes' logs, each under its node."""
        nodes: dict[str, list[Log]] = {}
        for line in lines:
            nodes.setdefault(line.name, []).append(line)
        for node, said in nodes.items():
            columns = rr.TextLog.columns(
                text=[f"{line.name.strip('/')}: {line.msg}" for line in said],
                level=[LEVELS.get(line.level, "INFO") for line in said],
            )
            self._send(f"{paths.LOG}/{node.strip('/')}", np.array([line.header.stamp.ns for line in said]), columns)

    def _write_body(self, body: Body, batch: Batch) -> None:
        if batch.plan is not None:
            strip = rr.LineStrips3D.columns(
                strips=[batch.plan.astype(np.float32)], radii=[REFERENCE_WIDTH], colors=[dimmed(body.colour)]
            )
            self._send(paths.reference(body.name), np.array([batch.plan_time]), strip)
            self._send(paths.goals(body.name), np.array([batch.plan_time]), _clouds([batch.plan[1:]]))
        times, transforms = body.transforms(batch)
        if len(times):
            self._send(paths.transforms(body.name), times, transforms)
        if len(batch.control):
            self._send(paths.angle(body.name), batch.control_times, _series(batch.control[:, :2]))
            self._send(paths.error(body.name), batch.control_times, _series(batch.control[:, 2:3]))
            self._send(paths.effort(body.name), batch.control_times, _series(batch.control[:, 3:]))
        if len(batch.goals):
            known = [each[~np.isnan(each).any(axis=1)] for each in batch.goals[:, None]]
            self._send(paths.goal(body.name), batch.goal_times, _clouds(known))
        if len(batch.scans):
            self._send(paths.scan(body.name), batch.scan_times, _clouds(batch.scans))
        for entity, ends, segments in (
            (paths.trail(body.name), batch.trail_times, batch.trail),
            (paths.belief(body.name), batch.belief_times, batch.belief),
        ):
            if len(segments):
                self._send(entity, ends, rr.LineStrips3D.columns(strips=segments.astype(np.float32)))

    def _plot(self, entity: str, times: Stamps, values: Floats) -> None:
        """Rows of one value for each robot; a plot of which nothing is known yet is not begun."""
        if not np.isnan(values).all():
            self._send(entity, times, _series(values))

    def _send(self, entity: str, times: Stamps, columns: rr.ComponentColumnList) -> None:
        index = rr.TimeColumn(paths.timeline(self._resets), duration=times.astype("timedelta64[ns]"))
        self._stream.send_columns(entity, [index], columns)
        self._begun = True

    def _log_styles(self) -> None:
        names, colours = [body.name for body in self._driving], [body.colour for body in self._driving]
        for plot in (paths.SPEED, paths.CROSS_TRACK, paths.ODOMETRY_ERROR, paths.DISTANCE):
            lines = rr.SeriesLines(colors=colours, names=names, widths=[1.5] * len(names))
            self._stream.log(plot, lines, static=True)
        commands = rr.SeriesLines(
            colors=[dimmed(each) for each in colours],
            names=[f"{name} command" for name in names],
            widths=[1.5] * len(names),
        )
        self._stream.log(paths.COMMANDED, commands, static=True)
        for body in self._arms:
            name, shades = body.name, [dimmed(body.colour), body.colour]
            lines = rr.SeriesLines(colors=shades, names=["reference", "angle"], widths=[1.5, 1.5])
            self._stream.log(paths.angle(name), lines, static=True)
            for single, said in ((paths.error(name), "error"), (paths.effort(name), "effort")):
                line = rr.SeriesLines(colors=shades[1:], names=[said], widths=[1.5])
                self._stream.log(single, line, static=True)

    @property
    def _driving(self) -> list[Body]:
        return [body for body in self._bodies.values() if not body.stands]

    @property
    def _arms(self) -> list[Body]:
        return [body for body in self._bodies.values() if body.stands]

    def _new_tables(self) -> None:
        self._gauges, self._odometry = Table(len(self._driving), 4), Table(len(self._driving), 1)

    def _layout(self) -> rr.blueprint.Blueprint:
        robots = [(body.name, body.tree_name) for body in self._bodies.values()]
        arms = {body.name for body in self._arms}
        return blueprint(robots, arms, self._extent, [paths.timeline(reset) for reset in range(self._resets + 1)])


def _clouds(clouds: Sequence[Floats]) -> rr.ComponentColumnList:
    """A cloud of points, each (n, 3), for each time."""
    every = np.concatenate(clouds).astype(np.float32)
    return rr.Points3D.columns(positions=every).partition([len(each) for each in clouds])


def _series(values: Floats) -> rr.ComponentColumnList:
    """A row of values (n, series) for each time."""
    return rr.Scalars.columns(scalars=values.ravel()).partition([values.shape[1]] * len(values))
