"""Unwritable files, taken ports, a killed recorder, and bounded memory."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import textwrap
from pathlib import Path

import psutil
import pytest

from services.logger.recording import Recording
from services.logger.screenshots import repaired
from services.runtime.errors import BadInput
from tests.harness.ports import free_port
from tests.harness.waiting import wait_until
from tests.services.logger.conftest import EXTENT, RecordedDrive
from tests.services.logger.recording_reader import entities, poses

ROOT = Path(__file__).resolve().parents[3]

RECORDER = """
    import sys, pathlib
    from services.logger.columns import RobotColumns
    from services.logger.recording import Recording
    from tests.services.logger.synthetic_drive import step_all, synthetic_fleet
    robots = synthetic_fleet()
    columns = {name: RobotColumns() for name in robots}
    file = pathlib.Path(sys.argv[1])
    with Recording(file, [(name, "burger") for name in robots], (0, 0, 1, 1), print) as recording:
        for count, now in enumerate(step_all(robots, 1000.0), start=1):
            for name, robot in robots.items():
                columns[name].add_truth([robot.truth()])
            if count % 25 == 0:
                recording.write({name: each.flush() for name, each in columns.items()})
                recording.commit()
                print(count, flush=True)
"""

LARGE_LOG = """
    import base64, pathlib, random, sys
    import psutil
    from messages.rosgraph import Log
    from messages.std import Header, Time
    from services.logger.recording import Recording
    file, port = pathlib.Path(sys.argv[1]), int(sys.argv[2])
    with Recording(file, [], (0, 0, 1, 1), print, port=port, memory_mib=16) as recording:
        before = psutil.Process().memory_info().rss
        for number in range(400):
            noise = base64.b64encode(random.Random(number).randbytes(375_000)).decode()
            recording.write_log([Log(header=Header(stamp=Time.of(number)), name="/n", msg=noise)])
            recording.commit()
        print((psutil.Process().memory_info().rss - before) >> 20)
"""


def python(program: str, *arguments: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(program), *map(str, arguments)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )


def test_a_killed_recorder_leaves_a_file_that_reads_to_the_last_batch(tmp_path: Path) -> None:
    with python(RECORDER, tmp_path / "run.rrd") as recorder:
        assert recorder.stdout is not None
        for expected in range(25, 501, 25):
            assert int(recorder.stdout.readline()) == expected
        recorder.kill()
        assert recorder.wait(60) == -signal.SIGKILL
    file = repaired(tmp_path / "run.rrd", tmp_path)
    for robot in ("tb3_0", "tb3_3"):
        times, _ = poses(file, robot, "base_footprint")
        whole = 475
        assert len(times) >= whole, "only the batch that was under way when the process died may be missing"
        assert times[:whole].tolist() == [20_000_000 * k for k in range(1, whole + 1)]


@pytest.mark.process
def test_a_torn_file_reads_up_to_where_it_is_torn(driven: RecordedDrive, tmp_path: Path) -> None:
    torn = tmp_path / "run.rrd"
    torn.write_bytes(driven.file.read_bytes()[: driven.file.stat().st_size // 2])
    times, _ = poses(repaired(torn, tmp_path), "tb3_0", "base_footprint")
    assert len(driven.truth["tb3_0"]) / 3 < len(times) < len(driven.truth["tb3_0"])


@pytest.mark.process
def test_a_file_that_is_cut_before_anything_moves_is_refused_instead_of_waited_for(tmp_path: Path) -> None:
    """The viewer then has shapes but no timeline, and reports nothing: waiting for a timeline would never end."""
    file = tmp_path / "run.rrd"
    with Recording(file, [("tb3_0", "burger")], EXTENT, pytest.fail):
        pass
    with pytest.raises(BadInput, match="contains only static shapes: did its logger end before the run began"):
        repaired(file, tmp_path)
    file.write_bytes(file.read_bytes()[: file.stat().st_size * 4 // 5])
    with pytest.raises(BadInput, match=r"run\.rrd is cut off after \d+ bytes, before anything that moves"):
        repaired(file, tmp_path)


def test_the_live_view_shows_the_run_on_the_loopback_only(tmp_path: Path) -> None:
    port = free_port()
    with Recording(tmp_path / "run.rrd", [("tb3_0", "burger")], EXTENT, pytest.fail, port) as recording:
        assert recording.url == f"rerun+http://127.0.0.1:{port}/proxy"
        assert wait_until(lambda: listening(port), what="a server, in a thread of its own") == ["127.0.0.1"]
    wait_until(lambda: not accepts(port), what="the server ends with the recording, in a thread of its own")


def listening(port: int) -> list[str]:
    """Return the addresses on which this process listens at a port."""
    own = psutil.Process().net_connections("tcp")
    return [each.laddr.ip for each in own if each.status == "LISTEN" and each.laddr.port == port]


def accepts(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def test_a_taken_port_costs_the_live_view_and_nothing_else(tmp_path: Path) -> None:
    said: list[str] = []
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        port = holder.getsockname()[1]
        with Recording(tmp_path / "run.rrd", [("tb3_0", "burger")], EXTENT, said.append, port) as recording:
            assert recording.url == ""
    assert len(said) == 1
    assert f"port {port} of 127.0.0.1 is not free" in said[0]
    assert "run.rrd" in said[0]
    assert "/tb3_0/tf_static" in set(entities(tmp_path / "run.rrd"))


def test_a_file_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    with (
        pytest.raises(BadInput, match=r"cannot be written.*nowhere"),
        Recording(tmp_path / "nowhere" / "run.rrd", [], EXTENT, pytest.fail),
    ):
        pass


def test_memory_for_late_viewers_is_bounded(tmp_path: Path) -> None:
    with python(LARGE_LOG, tmp_path / "run.rrd", free_port()) as process:
        grown, _ = process.communicate(timeout=300)
    assert process.returncode == 0
    assert int(grown) < 130, "MiB, after 200 MB of text that does not compress, with 16 MiB to keep it in"
