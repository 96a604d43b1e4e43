"""A real viewer without a window opens the recording without errors; test_view.py checks the pictures."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import psutil
import pytest

from services.logger.screenshots import Screenshot, headless_viewer, screenshots, wait_for_reply
from services.runtime.errors import BadInput
from tests.services.logger.conftest import LENGTH_S, RecordedDrive

DREW_TOO_SLOWLY = "Failed to render screenshot requested via ViewportCommand: PollError"
"""What the viewer reports of a screenshot that took a busy machine too long; its client gets no reply."""
PACKAGES = r"libvulkan1 mesa-vulkan-drivers"


@pytest.mark.process
def test_the_viewer_reports_nothing_wrong(driven: RecordedDrive) -> None:
    requested = 0

    def take_screenshot() -> bytes:
        nonlocal requested
        requested += 1
        return viewer.take_screenshot()

    with headless_viewer(driven.file) as viewer:
        wait_for_reply(partial(viewer.set_time, "sim_time", duration=30.0, play_state="paused"))
        wait_for_reply(take_screenshot)
        state = wait_for_reply(viewer.get_state)
        graph = wait_for_reply(partial(viewer.get_transform_graph, frame_filter="named"))
        errors = [each.message for each in wait_for_reply(viewer.get_logs) if each.level == "ERROR"]
    slow = [each for each in errors if each.startswith(DREW_TOO_SLOWLY)]
    assert [(view.name, view.reports) for view in state.views if view.reports] == []
    assert errors == slow
    assert len(slow) < requested
    assert {view.view_class for view in state.views} == {"3D", "TimeSeries", "TextLog"}
    timeline = state.recordings[0].timelines[0]
    assert (timeline.name, timeline.end) == ("sim_time", round(LENGTH_S * 1e9))
    edges = {(edge["parent"], edge["child"]) for edge in graph["edges"]}
    for k in range(4):
        assert ("world", f"tb3_{k}/base_footprint") in edges
        assert (f"tb3_{k}/base_link", f"tb3_{k}/wheel_left_link") in edges


@pytest.mark.process
def test_a_machine_that_cannot_draw_is_told_what_to_install(
    driven: RecordedDrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VK_DRIVER_FILES", "/nonexistent.json")
    monkeypatch.setenv("VK_ICD_FILENAMES", "/nonexistent.json")
    with pytest.raises(BadInput, match=PACKAGES):
        screenshots(driven.file, [Screenshot(tmp_path / "run.png")])
    assert children() == []


@pytest.mark.process
def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no recording"):
        screenshots(tmp_path / "absent.rrd", [Screenshot(tmp_path / "run.png")])
    (tmp_path / "bad.rrd").write_text("not a recording")
    with pytest.raises(BadInput, match=r"bad\.rrd is not a recording"):
        screenshots(tmp_path / "bad.rrd", [Screenshot(tmp_path / "run.png")])
    assert children() == []


def test_a_viewer_that_draws_is_asked_again_until_the_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    busy = iter([True, True, False, True])

    def ask() -> str:
        if next(busy):
            raise TimeoutError
        return "drawn"

    assert wait_for_reply(ask) == "drawn"
    monkeypatch.setattr("services.logger.screenshots.DRAW_TIMEOUT_S", 0.0)
    with pytest.raises(TimeoutError):
        wait_for_reply(ask)


def children() -> list[str]:
    return [each.name() for each in psutil.Process().children(recursive=True) if each.name() == "rerun"]
