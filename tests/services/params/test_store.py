"""The store on its file: kills, full disks, two at once, and the limits of its history."""

from __future__ import annotations

import re
import shutil
import sqlite3
from pathlib import Path

import pytest

from messages.parameters import (
    UndoParameters,
)
from services.params.store import SaveError, open_store
from services.runtime.errors import BadInput
from tests.services.params.server_on_file import SET, read_values, server_on_file, server_on_store, set_values


@pytest.mark.parametrize("harm", ["whole", "gone", "cut", "corrupt", "foreign"])
def test_a_log_left_by_a_kill_can_lose_nothing_that_was_acknowledged(harm: str, tmp_path: Path) -> None:
    """The file as after a kill between commit and reply: the change is only in the write-ahead log."""
    live, copy = tmp_path / "live", tmp_path / "copy"
    live.mkdir()
    copy.mkdir()
    with open_store(str(live / "params.db")) as store:
        at = server_on_store(store)
        set_values(at, p1=1.0)
        acknowledged = read_values(at)
        store._checkpoint = lambda: None  # type: ignore[method-assign]
        set_values(at, p1=2.0)
        unanswered = read_values(at)
        for each in live.iterdir():
            shutil.copy(each, copy)
    log = copy / "params.db-wal"
    data = log.read_bytes()
    assert len(data) > 4096
    match harm:
        case "gone":
            log.unlink()
        case "cut":
            log.write_bytes(data[: len(data) - 100])
        case "corrupt":
            log.write_bytes(data[:60] + b"\xff" * 40 + data[100:])
        case "foreign":
            log.write_bytes(b"nonsense" * 1000)
    with server_on_file(copy / "params.db") as at:
        assert read_values(at) == (unanswered if harm == "whole" else acknowledged)


def test_two_services_cannot_use_one_file(tmp_path: Path) -> None:
    file = tmp_path / "params.db"
    (tmp_path / "link.db").symlink_to(file)
    with open_store(str(file)):
        for name in (file, tmp_path / "link.db"):
            with pytest.raises(BadInput, match="another parameter service uses"), open_store(str(name)):
                pass
        with pytest.raises(sqlite3.OperationalError, match="locked"):
            sqlite3.connect(file, timeout=0.0).execute("SELECT * FROM saved")
    with open_store(str(file)):
        pass


def test_a_full_disk_refuses_the_change_and_leaves_everything_as_it_was(tmp_path: Path) -> None:
    with open_store(str(tmp_path / "params.db")) as store:
        at = server_on_store(store)
        set_values(at, p1=1.0)
        before = read_values(at)
        (pages,) = store._db.execute("PRAGMA page_count").fetchone()
        store._db.execute(f"PRAGMA max_page_count = {pages}")
        reason = ""
        for index in range(200):
            try:
                set_values(at, p1=1.0 + index, reference_type="sine")
            except SaveError as error:
                reason = str(error)
                break
            before = read_values(at)
        assert re.search(r"not saved .*full.*, so nothing was changed", reason)
        assert read_values(at) == before
        store._db.execute("PRAGMA max_page_count = 100000")
        set_values(at, p2=7.0)
        after = read_values(at)
    with server_on_file(tmp_path / "params.db") as at:
        assert read_values(at) == after


def test_the_past_is_bounded_in_number_and_in_bytes_even_for_services_that_live_shortly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("services.params.store.KEPT_CHANGES", 25)
    monkeypatch.setattr("services.params.store.KEPT_REQUESTS", 15)
    for life in range(3):
        with server_on_file(tmp_path / "params.db") as at:
            for index in range(15):
                set_values(at, p1=100.0 * life + index)
    with open_store(str(tmp_path / "params.db")) as store:
        assert [store._db.execute(f"SELECT count(*) FROM {table}").fetchone() for table in ("history", "requests")] == [
            (25,),
            (15,),
        ]
        at = server_on_store(store)
        assert read_values(at)[0]["p1"] == 214.0
        assert at.undo(UndoParameters(set=SET)).values
        monkeypatch.setattr("services.params.store.KEPT_BYTES", 1 << 16)
        monkeypatch.setattr("services.params.store._PRUNE_BYTES", 1 << 13)
        for index in range(25):
            set_values(at, reference_type="sine", text=f"{index:02}" * 1500)
        (kept,) = store._db.execute("SELECT sum(length(change) + length(back)) FROM history").fetchone()
        assert 1 << 15 < kept < (1 << 16) + (1 << 13)
        assert read_values(at)[1][0].after[1].value == "24" * 1500
