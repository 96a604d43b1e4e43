"""The folder of a run: logs, state, recording, measurements and report."""

from __future__ import annotations

import tempfile
from datetime import datetime
from pathlib import Path

import msgspec

from deploy.report.record import PICTURE_FILE, REPORT_FILE
from messages.elea import FleetState
from services.grader.records import MEASUREMENTS_FILE, TRAJECTORIES_FILE
from services.logger.earlier import earlier
from services.panel.address import FILE as PANEL_FILE
from services.runtime.errors import BadInput
from services.runtime.process import ROOT
from services.square import LOG_FILE

RUNS = ROOT / "runs"
RECORDING_FILE = "run.rrd"
BAG_FOLDER = "bag"
"""Where a run's recorder writes, in the folder of the run."""
METADATA_FILE = "metadata.yaml"
STATE_FILE = "processes.json"


def make_folder(fleet: str, report: str = "", now: datetime | None = None) -> Path:
    """The folder of a new run, ``runs/<time>-<fleet>`` or ``report``; raises BadInput when it cannot be written.

    What an earlier run left in ``report`` is removed, lest it be taken for this one's.
    """
    moment = f"{now or datetime.now():%Y%m%d-%H%M%S}-{fleet}"
    path = Path(report).absolute() if report else _unused(RUNS / moment)
    try:
        (path / "logs").mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
        for name in (MEASUREMENTS_FILE, TRAJECTORIES_FILE, REPORT_FILE, PICTURE_FILE, STATE_FILE, LOG_FILE, PANEL_FILE):
            (path / name).unlink(missing_ok=True)
        for part in (path / BAG_FOLDER).glob("*"):
            if part.name == METADATA_FILE or part.suffix == ".mcap":
                part.unlink()
        for each in (path / RECORDING_FILE, *earlier(path / RECORDING_FILE), *(path / "logs").glob("*.log*")):
            each.unlink(missing_ok=True)
    except OSError as error:
        raise BadInput(f"the folder {path} cannot be written: {error.strerror}; choose one with --report") from None
    return path


def latest_folder() -> Path | None:
    """The newest run in ``runs``."""
    return max((each for each in RUNS.glob("*") if (each / "logs").is_dir()), default=None)


def write_state(path: Path, state: FleetState) -> None:
    """Put the fleet's state beside the logs, whole or not at all; a full disk only makes it old."""
    beside = path / f".{STATE_FILE}"
    try:
        beside.write_bytes(msgspec.json.encode(state))
        beside.replace(path / STATE_FILE)
    except OSError:
        return


def read_state(path: Path) -> FleetState | None:
    """The state that a supervisor left in a run's folder."""
    try:
        return msgspec.json.decode((path / STATE_FILE).read_bytes(), type=FleetState)
    except (OSError, msgspec.MsgspecError):
        return None


def _unused(path: Path) -> Path:
    """Two runs of one second get different folders."""
    number, candidate = 1, path
    while candidate.exists():
        number += 1
        candidate = path.with_name(f"{path.name}-{number}")
    return candidate
