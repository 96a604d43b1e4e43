"""The location of a user's files: ELEA_HOME, the checkout, or the user's own folders."""

from __future__ import annotations

import os
import pwd
from pathlib import Path

import pytest

from services.runtime import user_folders
from services.runtime.errors import BadInput
from services.runtime.transport.unix_sockets import socket_folder
from services.runtime.user_folders import instances_folder, parameters_folder, runs_folder

ACCOUNT = pwd.getpwuid(os.geteuid()).pw_dir


def test_the_owner_of_the_checkout_has_results_in_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(user_folders, "ROOT", tmp_path)
    home = {"HOME": str(tmp_path / "anna")}
    assert runs_folder(home) == tmp_path / "runs"
    assert parameters_folder(home) == Path("params")


def test_others_have_results_and_parameters_in_their_own_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(user_folders, "ROOT", Path("/nowhere"))
    data = {"XDG_DATA_HOME": "/anna/data"}
    assert runs_folder(data) == Path("/anna/data/elea/runs")
    assert parameters_folder(data) == Path("/anna/data/elea/params")
    monkeypatch.setenv("HOME", "/anna")
    assert runs_folder({"HOME": "/anna"}) == Path("/anna/.local/share/elea/runs")
    assert instances_folder({"HOME": "/anna"}) == Path("/anna/.local/state/elea")


def test_elea_home_holds_everything() -> None:
    own = {"ELEA_HOME": "/course/anna", "XDG_STATE_HOME": "/state", "XDG_DATA_HOME": "/data"}
    assert runs_folder(own) == Path("/course/anna/runs")
    assert parameters_folder(own) == Path("/course/anna/params")
    assert instances_folder(own) == Path("/course/anna/state")
    with pytest.raises(BadInput, match="ELEA_HOME is 'runs/anna': give an absolute path"):
        runs_folder({"ELEA_HOME": "runs/anna"})


def test_each_home_has_sockets_of_its_own() -> None:
    homes = [{"HOME": ACCOUNT}, {"HOME": "/one"}, {"HOME": "/two"}, {"HOME": ACCOUNT, "ELEA_HOME": "/one/elea"}]
    folders = [socket_folder(each) for each in homes]
    assert len(set(folders)) == len(homes)
    assert folders[0].name == f"elea-{os.geteuid()}"
    assert socket_folder({"HOME": "/one/"}) == folders[1]
    assert socket_folder({}) == folders[0]
