"""The parameter file: a damaged one is rejected untouched, a valid one is read to the last value."""

from __future__ import annotations

import os
import random
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from messages.parameters import ParameterChange
from services.params.database_file import SCHEMA
from services.params.store import open_store
from services.runtime.errors import BadInput
from tests.services.params.parameter_client import arm_announcement, value_dict
from tests.services.params.server_harness import server_harness
from tests.services.params.server_on_file import read_values, server_on_file, server_on_store, set_values


@pytest.fixture(scope="module")
def valid_file(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any], tuple[ParameterChange, ...]]:
    """A file with a history, and its values and changes."""
    file = tmp_path_factory.mktemp("sound") / "params.db"
    with server_on_file(file) as at:
        for index in range(60):
            set_values(at, **{f"p{(index + each) % 120}": index + each / 8 for each in range(20)})
        held = read_values(at)
    return file, *held


def contents(folder: Path) -> dict[str, bytes]:
    return {each.name: each.read_bytes() for each in folder.iterdir()}


def spoilt(valid_file: Path, folder: Path, data: bytes) -> Path:
    folder.mkdir()
    file = folder / valid_file.name
    file.write_bytes(data)
    return file


def outcome(file: Path, held: Any) -> str:
    """Open a file; return ``refused`` (left untouched) or ``whole``, fail on anything else."""
    before = contents(file.parent)
    try:
        with server_on_file(file) as at:
            assert read_values(at) == held
    except BadInput as error:
        reason = str(error)
    else:
        return "whole"
    assert contents(file.parent) == before
    assert "left as it is" in reason
    assert str(file) in reason
    return "refused"


def test_what_is_saved_is_there_after_the_next_start(valid_file: Any, tmp_path: Path) -> None:
    file, *held = valid_file
    again = spoilt(file, tmp_path / "copy", file.read_bytes())
    for _ in range(2):
        assert outcome(again, tuple(held)) == "whole"


def test_a_file_truncated_anywhere_is_refused_or_whole(valid_file: Any, tmp_path: Path) -> None:
    file, *held = valid_file
    data, chance = file.read_bytes(), random.Random(7)
    cuts = [0, 1, 15, 16, 50, 99, 100, 4096, len(data) - 4096, *(chance.randrange(len(data)) for _ in range(30))]
    outcomes = [outcome(spoilt(file, tmp_path / str(i), data[:cut]), tuple(held)) for i, cut in enumerate(cuts)]
    assert set(outcomes) == {"refused"}


def test_corrupted_bytes_are_refused_or_harmless(valid_file: Any, tmp_path: Path) -> None:
    file, *held = valid_file
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


@pytest.mark.slow
def test_a_changed_value_is_found_though_the_database_is_in_order(valid_file: Any, tmp_path: Path) -> None:
    """In forty of the places where the value occurs, from the first to the last."""
    file, *_ = valid_file
    data, outcomes = file.read_bytes(), []
    parts = data.split(b"p7")
    places = len(parts) - 1
    for index in sorted({round(k * (places - 1) / 39) for k in range(40)}):
        damaged = b"p7".join(parts[: index + 1]) + b"p8" + b"p7".join(parts[index + 1 :])
        with pytest.raises(BadInput, match="damaged"), open_store(str(spoilt(file, tmp_path / str(index), damaged))):
            pass
        outcomes.append(index)
    assert len(outcomes) > 10


def test_damage_beside_a_log_that_a_kill_left_is_refused_with_both_untouched(tmp_path: Path) -> None:
    live, copy = tmp_path / "live", tmp_path / "copy"
    live.mkdir()
    copy.mkdir()
    with open_store(str(live / "params.db")) as store:
        at = server_on_store(store)
        set_values(at, p1=1.0)
        store._checkpoint = lambda: None  # type: ignore[method-assign]
        set_values(at, p2=2.0)
        for each in live.iterdir():
            shutil.copy(each, copy)
    file = copy / "params.db"
    assert (copy / "params.db-wal").stat().st_size > 4096
    file.write_bytes(file.read_bytes()[:-4096])
    assert outcome(file, None) == "refused"


def format_1(file: Path) -> Path:
    """Write a file in Elea's format 1."""
    with closing(sqlite3.connect(file)) as connection:
        connection.executescript((Path(__file__).parent / "data" / "format_1.sql").read_text())
    return file


def test_a_file_of_format_1_keeps_its_values_its_history_and_its_replies(tmp_path: Path) -> None:
    file = format_1(tmp_path / "params.db")
    for _ in range(2):
        with server_harness(str(file)) as at:
            at.server.announce(arm_announcement())
            assert at.get()["ref_angle"] == 10.0
            assert (at.get()["limits"], at.get()["ss_Kp"], at.get()["window"]) == ((1.0, 2.5), 2.0, 2)
            assert [(each.revision, each.kind, each.undone) for each in at.history()] == [
                (7, "set", False),
                (6, "undo", False),
                (5, "set", True),
                (4, "set", False),
                (3, "set", False),
            ]
            first = at.set(request="a", ref_angle=10, limits=(1, 2.5), offset=None)
            assert (first.revision, value_dict(first)["ss_Kp"]) == (3, 37.5), "the answer of then"
    with server_harness(str(file)) as at:
        at.server.announce(arm_announcement())
        assert at.undo().revision > 7
        assert at.get()["ss_Kp"] == 37.5
    with closing(sqlite3.connect(file)) as connection:
        assert connection.execute("PRAGMA user_version").fetchone() == (2,)
        names = connection.execute("SELECT name FROM sqlite_schema WHERE type = 'table' AND name NOT LIKE 'sqlite%'")
        assert {name for (name,) in names} == {"saved", "history", "requests"}


def test_a_damaged_file_of_format_1_is_refused_untouched(tmp_path: Path) -> None:
    data = format_1(tmp_path / "params.db").read_bytes()
    for index, (good, bad) in enumerate(((b"[1.0, 2.5]", b"[1.0, 2.4]"), (b"ref_angle", b"ref_angel"))):
        file = spoilt(Path("params.db"), tmp_path / str(index), data.replace(good, bad))
        assert outcome(file, None) == "refused"
    assert outcome(spoilt(Path("params.db"), tmp_path / "cut", data[:-4096]), None) == "refused"


def test_a_conversion_that_fails_leaves_a_file_of_format_1(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = format_1(tmp_path / "params.db")
    monkeypatch.setattr("services.params.database_file.SCHEMA", f"{SCHEMA} no statement;")
    with pytest.raises(BadInput, match="cannot use the parameter file"), open_store(str(file)):
        pass
    monkeypatch.undo()
    with server_harness(str(file)) as at:
        at.server.announce(arm_announcement())
        assert at.get()["ref_angle"] == 10.0


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
    with pytest.raises(BadInput, match=says), open_store(str(file)):
        pass
    assert before == (contents(tmp_path) if file.is_file() else {})


def foreign(file: Path, script: str) -> None:
    connection = sqlite3.connect(file)
    connection.executescript(script + "; CREATE TABLE u(x)")
    connection.close()


def test_a_log_whose_file_is_gone_is_not_silently_dropped(tmp_path: Path) -> None:
    file = tmp_path / "params.db"
    (tmp_path / "params.db-wal").write_bytes(b"x" * 99)
    with pytest.raises(BadInput, match="is gone, but its log"), open_store(str(file)):
        pass
    assert not file.exists()


@contextmanager
def as_nobody() -> Iterator[None]:
    """Run without a superuser's permissions."""
    before = os.geteuid()
    if before == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(before)


def test_a_folder_that_cannot_be_written_is_named() -> None:
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:
        file = Path(folder) / "params.db"
        with open_store(str(file)):
            pass
        file.chmod(0o666)
        Path(folder).chmod(0o555)
        with as_nobody():
            with (
                pytest.raises(BadInput, match=r"cannot use .*params\.db.*is its folder, .*, read-only"),
                open_store(str(file)),
            ):
                pass
            refused = pytest.raises(BadInput, match=r"cannot write .*other\.db \(Permission denied\): name another")
            with refused, open_store(f"{folder}/other.db"):
                pass
        Path(folder).chmod(0o755)
        assert [each.name for each in Path(folder).iterdir()] == ["params.db"]


def test_folders_are_made_and_memory_is_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with server_on_file("deep/down/params.db"), server_on_file(""), server_on_file(":memory:"):
        assert sorted(each.name for each in tmp_path.iterdir()) == ["deep"]
