"""A run as numpy arrays: ``load("runs/20261122-lab")`` gives its report, the robots' trails, and topics of its bag.

from deploy.report.load import load

run = load("runs/20261122-101500-lab")
run.report.robots["tb3_0"].odometry_error_max_m
trail = run.trails["tb3_0"]
trail["x"], trail["odom_x"]
run.topic("/tb3_0/odom")["pose.pose.position.x"]
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from deploy.report.record import REPORT_FILE, Report, read_report
from messages.base import WrongPayload
from services.bag.csv_export import MAX_COLUMNS, flatten
from services.bag.reader import Bag, open_bag, plain_decoder
from services.grader.records import ARM_TRAIL_COLUMNS, ROBOT_TRAIL_COLUMNS, TRAJECTORIES_FILE
from services.runtime.errors import BadInput, unknown_name

if TYPE_CHECKING:
    import pandas

BAG_FOLDER = "bag"
"""The recording in a run's folder."""


@dataclass(frozen=True)
class Table(Mapping[str, np.ndarray]):
    """Columns of one length by name: ``table["x"]`` has shape (n,)."""

    columns: Mapping[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        try:
            return self.columns[name]
        except KeyError:
            raise unknown_name("column", name, self.columns) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    @property
    def rows(self) -> int:
        """The length of the columns."""
        return len(next(iter(self.columns.values()), ()))

    def to_pandas(self) -> pandas.DataFrame:
        """Return the table as a pandas data frame; raises BadInput if pandas is not installed."""
        try:
            import pandas
        except ImportError:
            raise BadInput("pandas is not installed: use the columns, which are numpy arrays") from None
        return pandas.DataFrame(dict(self.columns))


@dataclass(frozen=True)
class Run:
    """The data in the folder of a run.

    ``trails`` has a table for each robot: s, m, rad and m/s for bases, degrees and N m for arms, nan where unknown; the
    columns are those of ``services/grader/records.py``. ``paths`` are the corners of each base's reference, shape (n,
    2) in m, empty without one.
    """

    folder: Path
    report: Report
    trails: Mapping[str, Table]
    paths: Mapping[str, np.ndarray] = field(default_factory=dict)

    @cached_property
    def bag(self) -> Bag:
        """The recording; raises BadInput for a run without one."""
        path = self.folder / BAG_FOLDER
        if not path.is_dir():
            raise BadInput(f"the run {self.folder} has no bag: record one with ./elea up --record")
        return open_bag(path)

    def topics(self) -> dict[str, str]:
        """Return the types of the recorded topics by name."""
        return {each.topic: each.type for each in self.bag.channels()}

    def topic(self, name: str) -> Table:
        """Return the messages of a recorded topic, with a column for each field.

        Column ``time`` is simulation time and ``log_time`` wall time, both in s. Numbers are float64, with nan where a
        message has no such field; other values are objects. Paths of fields are joined by dots, as in
        ``pose.position.x``.

        Raises:
            BadInput: there is no bag, no such topic in it, or its type cannot be read.
        """
        wanted = "/" + name.strip("/")
        rows: list[dict[str, Any]] = []
        times: list[tuple[float, float]] = []
        readers: dict[Any, Any] = {}
        for entry in self.bag.entries():
            if entry.channel.topic != wanted:
                continue
            try:
                read = readers.get(entry.channel) or readers.setdefault(entry.channel, plain_decoder(entry.channel))
                rows.append(dict(flatten(read(entry.data))))
            except WrongPayload as error:
                raise BadInput(f"{wanted} in {self.bag.path}: {error}") from None
            times.append((entry.publish_time / 1e9, entry.log_time / 1e9))
        if not rows:
            raise unknown_name("topic", wanted, self.topics(), str(self.bag.path))
        names = list(dict.fromkeys(each for row in rows for each in row))[:MAX_COLUMNS]
        stamps = np.array(times)
        return Table(
            {"time": stamps[:, 0], "log_time": stamps[:, 1]}
            | {each: _column([row.get(each) for row in rows]) for each in names}
        )


def load(folder: str | Path) -> Run:
    """Load the run in a folder; raises BadInput if it has no report, or an unreadable one."""
    path = Path(folder).expanduser()
    if not path.is_dir():
        raise BadInput(f"there is no folder {path}: give the folder of a run, as ./elea up prints it")
    report = read_report(path)
    if report is None:
        raise BadInput(f"{path} holds no {REPORT_FILE} that can be read: is it the folder of a run that has ended?")
    arrays = read_trails(path)
    robots = [name.removesuffix(".trail") for name in arrays if name.endswith(".trail")]
    return Run(
        folder=path,
        report=report,
        trails={name: _trail(arrays[f"{name}.trail"]) for name in robots},
        paths={name: arrays[f"{name}.path"] for name in robots if f"{name}.path" in arrays},
    )


def read_trails(folder: Path) -> dict[str, np.ndarray]:
    """Return the arrays of a run's trajectories; raises BadInput."""
    path = folder / TRAJECTORIES_FILE
    try:
        with np.load(path, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except FileNotFoundError:
        raise BadInput(f"there is no {path}: the grader was killed before it could write it") from None
    except (OSError, ValueError, BadZipFile, EOFError) as error:
        raise BadInput(f"{path} cannot be read: {error}") from None


def _trail(rows: np.ndarray) -> Table:
    columns = ARM_TRAIL_COLUMNS if rows.shape[1] == len(ARM_TRAIL_COLUMNS) else ROBOT_TRAIL_COLUMNS
    return Table(dict(zip(columns, rows.T, strict=True)))


def _column(values: list[Any]) -> np.ndarray:
    """Return numbers as float64, with nan for None; anything else as objects."""
    if all(each is None or isinstance(each, int | float) for each in values):
        return np.array([np.nan if each is None else each for each in values], float)
    return np.array(values, object)
