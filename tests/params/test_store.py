"""The file of parameters: what is not sound is refused untouched, what is sound is there to the last value."""

from __future__ import annotations

import random
import re
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from messages.parameters import HistoryOf, ParameterChange, ParameterDescription, ParameterSet, SetParameters
from services.params.desk import Desk
from services.params.store import NotSaved, Store, opened
from services.runtime.errors import BadInput
from services.runtime.log import Log
from tests.params.sets import ARM, arm, plain, values

SET = "/robot_control"
WIDE = (*ARM, *(ParameterDescription(name=f"p{i}", default=0.0) for i in range(120)))


@contextmanager
def desk(file: Path | str) -> Iterator[Desk]:
    with opened(str(file)) as store:
        yield of(store)


def of(store: Store) -> Desk:
    made = Desk(store, lambda news: None, Log("/params", "fatal"), lambda: 0, lambda node: True)
    made.announce(arm(parameters=WIDE))
    return made


def put(at: Desk, **given: Any) -> None:
    at.set(SetParameters(set=SET, values=values(**given), id=str(given), who="tester"))


def seen(at: Desk) -> tuple[dict[str, Any], tuple[ParameterChange, ...]]:
    return plain(at.get(ParameterSet(set=SET))), at.history(HistoryOf(set=SET)).changes


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any], tuple[ParameterChange, ...]]:
    """A file with a history, and what lies in it."""
    file = tmp_path_factory.mktemp("sound") / "params.db"
    with desk(file) as at:
        for index in range(60):
            put(at, **{f"p{(index + each) % 120}": index + each / 8 for each in range(20)})
        held = seen(at)
    return file, *held


def contents(folder: Path) -> dict[str, bytes]:
    return {each.name: each.read_bytes() for each in folder.iterdir()}


def spoilt(sound: Path, folder: Path, data: bytes) -> Path:
    folder.mkdir()
    file = folder / sound.name
    file.write_bytes(data)
    return file


def outcome(file: Path, held: Any) -> str:
    """``refused``, and then untouched, or ``whole``; anything else fails."""
    before = contents(file.parent)
    try:
        with desk(file) as at:
            assert seen(at) == held
    except BadInput as error:
        reason = str(error)
    else:
        return "whole"
    assert contents(file.parent) == before
    assert "left as it is" in reason
    assert str(file) in reason
    return "refused"


def test_what_is_saved_is_there_after_the_next_start(sound: Any, tmp_path: Path) -> None:
    file, *held = sound
    again = spoilt(file, tmp_path / "copy", file.read_bytes())
    for _ in range(2):
        assert outcome(again, tuple(held)) == "whole"


def test_a_file_truncated_anywhere_is_refused_or_whole(sound: Any, tmp_path: Path) -> None:
    file, *held = sound
    data, chance = file.read_bytes(), random.Random(7)
    cuts = [0, 1, 15, 16, 50, 99, 100, 4096, len(data) - 4096, *(chance.randrange(len(data)) for _ in range(30))]
    outcomes = [outcome(spoilt(file, tmp_path / str(i), data[:cut]), tuple(held)) for i, cut in enumerate(cuts)]
    assert set(outcomes) == {"refused"}


def test_corrupted_bytes_are_refused_or_harmless(sound: Any, tmp_path: Path) -> None:
    file, *held = sound
    data, chance = file.read_bytes(), random.Random(8)
    outcomes = []
    for index in range(80):
        damaged = bytearray(data)
        for _ in range(chance.choice((1, 4, 64))):
            place = chance.randrange(len(data))
            damaged[place] ^= chance.randrange(1, 256)
        outcomes.append(outcome(spoilt(file, tmp_path / str(index), bytes(damaged)), tuple(held)))
        shutil.rmtree(tmp_path / str(index))
    assert outcomes.count("refused") > 40


def test_a_changed_value_is_found_though_the_database_is_in_order(sound: Any, tmp_path: Path) -> None:
    file, *_ = sound
    damaged = file.read_bytes().replace(b"p7", b"p8", 1)
    with pytest.raises(BadInput, match="damaged"), opened(str(spoilt(file, tmp_path / "a", damaged))):
        pass


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda file: file.write_bytes(b""), "is empty: it was truncated"),
        (lambda file: file.write_text("kp: 1\n" * 99), "not a database of parameters"),
        (lambda file: foreign(file, "CREATE TABLE t(x)"), "another program"),
        (lambda file: foreign(file, f"PRAGMA application_id = {0x456C6561}; PRAGMA user_version = 9"), "format 9"),
        (lambda file: file.mkdir(), "cannot write"),
    ],
)
def test_what_is_not_ours_is_refused_untouched(make: Any, says: str, tmp_path: Path) -> None:
    file = tmp_path / "params.db"
    make(file)
    before = contents(tmp_path) if file.is_file() else {}
    with pytest.raises(BadInput, match=says), opened(str(file)):
        pass
    assert before == (contents(tmp_path) if file.is_file() else {})


def foreign(file: Path, script: str) -> None:
    connection = sqlite3.connect(file)
    connection.executescript(script + "; CREATE TABLE u(x)")
    connection.close()


def test_a_log_whose_file_is_gone_is_not_silently_dropped(tmp_path: Path) -> None:
    file = tmp_path / "params.db"
    (tmp_path / "params.db-wal").write_bytes(b"x" * 99)
    with pytest.raises(BadInput, match="is gone, but its log"), opened(str(file)):
        pass
    assert not file.exists()


@pytest.mark.parametrize("harm", ["whole", "gone", "cut", "corrupt", "foreign"])
def test_a_log_left_by_a_kill_can_lose_nothing_that_was_acknowledged(harm: str, tmp_path: Path) -> None:
    """The file as a kill leaves it between commit and answer: the change is in the log alone."""
    live, copy = tmp_path / "live", tmp_path / "copy"
    live.mkdir()
    copy.mkdir()
    with opened(str(live / "params.db")) as store:
        at = of(store)
        put(at, p1=1.0)
        acknowledged = seen(at)
        store._into_file = lambda: None  # type: ignore[method-assign]
        put(at, p1=2.0)
        unanswered = seen(at)
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
    with desk(copy / "params.db") as at:
        assert seen(at) == (unanswered if harm == "whole" else acknowledged)


def test_two_services_cannot_use_one_file(tmp_path: Path) -> None:
    file = tmp_path / "params.db"
    (tmp_path / "link.db").symlink_to(file)
    with opened(str(file)):
        for name in (file, tmp_path / "link.db"):
            with pytest.raises(BadInput, match="another parameter service uses"), opened(str(name)):
                pass
        with pytest.raises(sqlite3.OperationalError, match="locked"):
            sqlite3.connect(file, timeout=0.0).execute("SELECT * FROM sets")
    with opened(str(file)):
        pass


def test_a_full_disk_refuses_the_change_and_leaves_everything_as_it_was(tmp_path: Path) -> None:
    with opened(str(tmp_path / "params.db")) as store:
        at = of(store)
        put(at, p1=1.0)
        before = seen(at)
        (pages,) = store._db.execute("PRAGMA page_count").fetchone()
        store._db.execute(f"PRAGMA max_page_count = {pages}")
        reason = ""
        for index in range(200):
            try:
                put(at, p1=1.0 + index, reference_type="sine")
            except NotSaved as error:
                reason = str(error)
                break
            before = seen(at)
        assert re.search(r"not saved .*full.*, so nothing was changed", reason)
        assert seen(at) == before
        store._db.execute("PRAGMA max_page_count = 100000")
        put(at, p2=7.0)
        after = seen(at)
    with desk(tmp_path / "params.db") as at:
        assert seen(at) == after


def test_folders_are_made_and_memory_is_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with desk("deep/down/params.db"), desk(""), desk(":memory:"):
        assert sorted(each.name for each in tmp_path.iterdir()) == ["deep"]
