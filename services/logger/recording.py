"""Writes a rerun recording: scenes and styles once, then batches of columns, to a file and live viewers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.blueprint import Blueprint

from messages.gazebo import WorldStates
from messages.rosgraph import DEBUG, ERROR, FATAL, INFO, WARN, Log
from messages.visualization import MarkerArray
from models.palette import colours
from services.logger import DEFAULT_EXTENT, entity_paths
from services.logger.blueprint import Extent, blueprint
from services.logger.columns import Batch
from services.logger.scene import RobotScene, darkened
from services.logger.world_scene import WorldScene
from services.runtime.errors import BadInput
from services.runtime.ports import bind_error

HOST = "127.0.0.1"

FLUSH_TIMEOUT_S = 5.0
"""Maximum wall time [s] for the disk and the server to accept the data."""


def open_sinks(
    stream: rr.RecordingStream, file: Path, footer: bool, port: int | None, memory_mib: int, layout: Blueprint
) -> tuple[str, str]:
    """Connect ``stream`` to ``file`` and, with a ``port``, to a server for viewers.

    Returns the viewer's URL and the problem with the live view; one of them is empty, without a port both. Raises
    BadInput if the file cannot be written.
    """
    url, problem = "", ""
    if port is not None and (problem := _port_error(port)) == "":
        server = rr.GrpcServerSink(HOST, port, server_memory_limit=f"{memory_mib}MiB")
        _connect(stream, layout, server, _file_sink(file, footer))
        try:
            stream.flush(timeout_sec=FLUSH_TIMEOUT_S)
            url = server.uri
        except RuntimeError as error:
            problem = f"the server for viewers on {HOST}:{port} did not start: {error}"
    if not url:
        _connect(stream, layout, _file_sink(file, footer))
    return url, problem


def _file_sink(file: Path, footer: bool) -> rr.FileSink:
    return rr.FileSink(file, write_footer=footer)


def _connect(stream: rr.RecordingStream, layout: Blueprint, *sinks: rr.GrpcServerSink | rr.FileSink) -> None:
    try:
        stream.set_sinks(*sinks, default_blueprint=layout)
    except RuntimeError as error:
        raise BadInput(f"the recording cannot be written: {error}") from None


def _port_error(port: int) -> str:
    """Explain why the port is not free; empty if it is. Checked first, as rerun's server fails later and silently."""
    why = bind_error(port)
    return (
        f"no live view: port {port} of {HOST} is not free ({why.strerror}); is another logger running?" if why else ""
    )


Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]

STALE_NS = 500_000_000
"""Time [ns] after its last row beyond which a robot has no value and is not waited for."""


class FleetSeries:
    """Joins the rows of ``robots``, each of ``width`` values; a robot holds its value until its next row.

    Each time is drained once, after all robots that are not stale have reached it.
    """

    def __init__(self, robots: int, width: int) -> None:
        self._width = width
        self._times: list[Stamps] = [np.empty(0, np.int64)] * robots
        self._values: list[Floats] = [np.empty((0, width))] * robots
        self._drained_upto = -1

    def add(self, robot: int, times: Stamps, values: Floats) -> None:
        """Add rows of one robot: ``times`` (n,) [ns], ``values`` (n, width)."""
        self._times[robot] = np.concatenate((self._times[robot], times))
        self._values[robot] = np.concatenate((self._values[robot], values))

    def drain(self, everything: bool = False) -> tuple[Stamps, Floats]:
        """Return new times (n,) [ns] and values (n, robots, width), NaN for a robot without a value."""
        ends = [int(each[-1]) for each in self._times if len(each)]
        if not ends:
            return np.empty(0, np.int64), np.empty((0, len(self._times), self._width))
        reached = max(ends) if everything else min(end for end in ends if end > max(ends) - STALE_NS)
        pending = np.unique(np.concatenate(self._times))
        times = pending[(pending > self._drained_upto) & (pending <= reached)]
        values = np.stack([self._values_at(robot, times) for robot in range(len(self._times))], axis=1)
        self._drained_upto = max(self._drained_upto, reached)
        for robot, own in enumerate(self._times):
            used = max(0, int(np.searchsorted(own, reached, side="right")) - 1)
            self._times[robot], self._values[robot] = own[used:], self._values[robot][used:]
        return times, values

    def _values_at(self, robot: int, times: Stamps) -> Floats:
        own, values = self._times[robot], self._values[robot]
        held = np.full((len(times), self._width), np.nan)
        at = np.searchsorted(own, times, side="right") - 1
        known = at >= 0
        known[known] = times[known] - own[at[known]] <= STALE_NS
        held[known] = values[at[known]]
        return held


APPLICATION = "elea"

LEVELS = {DEBUG: "DEBUG", INFO: "INFO", WARN: "WARN", ERROR: "ERROR", FATAL: "CRITICAL"}

REFERENCE_WIDTH = -0.7
"""Radius of a reference path; rerun interprets a negative one as points on the screen instead of metres."""


class Recording:
    """Writes ``file``, and serves viewers on ``port`` of 127.0.0.1 unless that is None; ``with`` opens and closes it.

    ``robots`` are (name, model); each robot's frames have its prefix in ``prefixes``, by default its name and a slash.
    If the live view cannot start, this is reported to ``warn`` and the file is still written.

    ``with`` raises BadInput for a file that cannot be written or an unknown model.
    """

    def __init__(
        self,
        file: Path,
        robots: Sequence[tuple[str, str]],
        extent: Extent,
        warn: Callable[[str], None],
        port: int | None = None,
        memory_mib: int = 256,
        footer: bool = False,
        prefixes: Mapping[str, str] | None = None,
    ) -> None:
        self.file, self.url = file, ""
        self._robots, self._extent, self._warn = robots, extent, warn
        self._prefixes = prefixes or {}
        self._port, self._memory_mib, self._footer = port, memory_mib, footer
        self._resets = 0
        self._has_data = False
        self._images: dict[str, str] = {}

    def __enter__(self) -> Self:
        colour = colours(name for name, _ in self._robots)
        scenes = [
            RobotScene(name, model, self._prefixes.get(name, f"{name}/"), colour[name]) for name, model in self._robots
        ]
        self._scenes = {scene.name: scene for scene in scenes}
        self._reset_series()
        self._stream = rr.RecordingStream(APPLICATION)
        self._stream.set_log_time_enabled(False)
        self._stream.set_log_tick_enabled(False)
        self.url, problem = open_sinks(
            self._stream, self.file, self._footer, self._port, self._memory_mib, self._layout()
        )
        if problem:
            self._warn(f"{problem}; the recording continues in {self.file}")
        self._stream.log("/", rr.CoordinateFrame("world"), rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for scene in scenes:
            scene.log_to(self._stream)
        self._log_styles()
        self._world: WorldScene | None = None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.commit()
        self._stream.disconnect()

    def log_at(self, entity: str, time_ns: int | None, *shapes: rr.AsComponents) -> None:
        """Log shapes of an entity at a simulated time [ns], or static without one."""
        if time_ns is None:
            self._stream.log(entity, *shapes, static=True)
            return
        duration = np.timedelta64(time_ns, "ns")
        self._stream.set_time(entity_paths.timeline(self._resets), duration=duration)
        self._stream.log(entity, *shapes)
        self._stream.reset_time()
        self._has_data = True

    def show_images(self, images: Mapping[str, str]) -> None:
        """Show a view for each image topic; ``images`` maps topics to entities."""
        if len(images) != len(self._images):
            self._images = dict(images)
            self._stream.send_blueprint(self._layout())

    def commit(self) -> None:
        """Block until all data is in the file, so that a killed process loses none and no backlog grows."""
        try:
            self._stream.flush(timeout_sec=FLUSH_TIMEOUT_S)
        except (RuntimeError, ValueError) as failure:
            self._warn(f"a part of the recording {self.file} may be missing: {failure}")

    def restart(self) -> None:
        """Start a new timeline, since simulation time starts again after a reset."""
        if self._has_data:
            self._resets, self._has_data = self._resets + 1, False
            self._reset_series()
            self._stream.send_blueprint(self._layout())
            if self._world is not None:
                self._world.begin()

    def set_world(self, array: MarkerArray) -> None:
        """Log the bodies of the world."""
        self._world = WorldScene(array, self._warn)
        self._world.log_to(self._stream)
        self._world.begin()
        if self._extent == DEFAULT_EXTENT and (extent := self._world.extent) is not None:
            self._extent = extent
            self._stream.send_blueprint(self._layout())

    def write_world(self, states: Sequence[WorldStates]) -> None:
        """Append the states of the world's moving bodies."""
        if self._world is None:
            return
        self._world.add_states(states)
        if (rows := self._world.transforms()) is not None:
            self._send(entity_paths.WORLD_TF, *rows)

    def write(self, batches: Mapping[str, Batch], last: bool = False) -> None:
        """Append the robots' batches; plots wait for the slowest robot, except for the ``last`` batches."""
        for scene in self._scenes.values():
            if (batch := batches.get(scene.name)) is not None:
                self._write_robot(scene, batch)
        for index, scene in enumerate(self._driving):
            if (batch := batches.get(scene.name)) is not None:
                self._scalars.add(index, batch.times, batch.scalars)
                self._odometry.add(index, batch.odometry_times, batch.odometry_error)
        times, scalars = self._scalars.drain(last)
        for number, plot in enumerate(
            (entity_paths.SPEED, entity_paths.COMMANDED, entity_paths.CROSS_TRACK, entity_paths.DISTANCE)
        ):
            self._plot(plot, times, scalars[:, :, number])
        times, error = self._odometry.drain(last)
        self._plot(entity_paths.ODOMETRY_ERROR, times, error[:, :, 0])

    def write_log(self, lines: Sequence[Log]) -> None:
        """Append log messages of the nodes, each under its node."""
        nodes: dict[str, list[Log]] = {}
        for line in lines:
            nodes.setdefault(line.name, []).append(line)
        for node, entries in nodes.items():
            columns = rr.TextLog.columns(
                text=[f"{line.name.strip('/')}: {line.msg}" for line in entries],
                level=[LEVELS.get(line.level, "INFO") for line in entries],
            )
            self._send(
                f"{entity_paths.LOG}/{node.strip('/')}", np.array([line.header.stamp.ns for line in entries]), columns
            )

    def _write_robot(self, scene: RobotScene, batch: Batch) -> None:
        if batch.plan is not None:
            strip = rr.LineStrips3D.columns(
                strips=[batch.plan.astype(np.float32)], radii=[REFERENCE_WIDTH], colors=[darkened(scene.colour)]
            )
            self._send(entity_paths.reference(scene.name), np.array([batch.plan_time]), strip)
            self._send(entity_paths.goals(scene.name), np.array([batch.plan_time]), _point_columns([batch.plan[1:]]))
        times, transforms = scene.transforms(batch)
        if len(times):
            self._send(entity_paths.transforms(scene.name), times, transforms)
        if len(batch.control):
            self._send(entity_paths.angle(scene.name), batch.control_times, _scalar_columns(batch.control[:, :2]))
            self._send(entity_paths.error(scene.name), batch.control_times, _scalar_columns(batch.control[:, 2:3]))
            self._send(entity_paths.effort(scene.name), batch.control_times, _scalar_columns(batch.control[:, 3:]))
        if len(batch.goals):
            known = [each[~np.isnan(each).any(axis=1)] for each in batch.goals[:, None]]
            self._send(entity_paths.goal(scene.name), batch.goal_times, _point_columns(known))
        if len(batch.scans):
            self._send(entity_paths.scan(scene.name), batch.scan_times, _point_columns(batch.scans))
        for entity, ends, segments in (
            (entity_paths.trail(scene.name), batch.trail_times, batch.trail),
            (entity_paths.odometry_trail(scene.name), batch.odometry_trail_times, batch.odometry_trail),
        ):
            if len(segments):
                self._send(entity, ends, rr.LineStrips3D.columns(strips=segments.astype(np.float32)))

    def _plot(self, entity: str, times: Stamps, values: Floats) -> None:
        """Send rows with one value per robot, once any value is known."""
        if not np.isnan(values).all():
            self._send(entity, times, _scalar_columns(values))

    def _send(self, entity: str, times: Stamps, columns: rr.ComponentColumnList) -> None:
        index = rr.TimeColumn(entity_paths.timeline(self._resets), duration=times.astype("timedelta64[ns]"))
        self._stream.send_columns(entity, [index], columns)
        self._has_data = True

    def _log_styles(self) -> None:
        names, colours = [scene.name for scene in self._driving], [scene.colour for scene in self._driving]
        for plot in (entity_paths.SPEED, entity_paths.CROSS_TRACK, entity_paths.ODOMETRY_ERROR, entity_paths.DISTANCE):
            lines = rr.SeriesLines(colors=colours, names=names, widths=[1.5] * len(names))
            self._stream.log(plot, lines, static=True)
        commands = rr.SeriesLines(
            colors=[darkened(each) for each in colours],
            names=[f"{name} command" for name in names],
            widths=[1.5] * len(names),
        )
        self._stream.log(entity_paths.COMMANDED, commands, static=True)
        for scene in self._arms:
            name, shades = scene.name, [darkened(scene.colour), scene.colour]
            lines = rr.SeriesLines(colors=shades, names=["reference", "angle"], widths=[1.5, 1.5])
            self._stream.log(entity_paths.angle(name), lines, static=True)
            for single, label in ((entity_paths.error(name), "error"), (entity_paths.effort(name), "effort")):
                line = rr.SeriesLines(colors=shades[1:], names=[label], widths=[1.5])
                self._stream.log(single, line, static=True)

    @property
    def _driving(self) -> list[RobotScene]:
        return [scene for scene in self._scenes.values() if not scene.is_arm]

    @property
    def _arms(self) -> list[RobotScene]:
        return [scene for scene in self._scenes.values() if scene.is_arm]

    def _reset_series(self) -> None:
        self._scalars, self._odometry = FleetSeries(len(self._driving), 4), FleetSeries(len(self._driving), 1)

    def _layout(self) -> rr.blueprint.Blueprint:
        robots = [(scene.name, scene.tree_name) for scene in self._scenes.values()]
        arms = {scene.name for scene in self._arms}
        timelines = [entity_paths.timeline(reset) for reset in range(self._resets + 1)]
        return blueprint(robots, arms, self._extent, timelines, self._images)


def _point_columns(clouds: Sequence[Floats]) -> rr.ComponentColumnList:
    """Return the columns of a point cloud (n, 3) per time."""
    every = np.concatenate(clouds).astype(np.float32)
    return rr.Points3D.columns(positions=every).partition([len(each) for each in clouds])


def _scalar_columns(values: Floats) -> rr.ComponentColumnList:
    """Return the columns of a row of values (n, series) per time."""
    return rr.Scalars.columns(scalars=values.ravel()).partition([values.shape[1]] * len(values))
