"""The Git hook that ``elea check --install-hook`` installs; tests/architecture runs the steps of the check."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from deploy.commands.check import install_pre_commit_hook
from services.runtime.errors import BadInput


def git(*arguments: str, at: Path) -> subprocess.CompletedProcess[str]:
    who = {"GIT_AUTHOR_NAME": "a", "GIT_AUTHOR_EMAIL": "a", "GIT_COMMITTER_NAME": "a", "GIT_COMMITTER_EMAIL": "a"}
    environment = {**os.environ, **who, "GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull}
    return subprocess.run(["git", *arguments], cwd=at, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A repository whose check passes unless the file ``no`` exists or Git's variables are set."""
    assert git("init", "--quiet", at=tmp_path).returncode == 0
    check = tmp_path / "elea"
    check.write_text('#!/bin/sh\necho "$@" >> asked\n[ ! -e no ] && [ -z "${GIT_DIR-}${GIT_INDEX_FILE-}" ]\n')
    check.chmod(0o755)
    return tmp_path


@pytest.mark.process
def test_the_hook_stops_a_commit_that_fails_the_check(repository: Path) -> None:
    hook = install_pre_commit_hook(repository)
    assert hook == repository / ".git/hooks/pre-commit"
    assert install_pre_commit_hook(repository) == hook, "again does no harm"
    commit = ("commit", "--quiet", "--allow-empty", "-m", "x")
    assert git(*commit, at=repository).returncode == 0
    assert (repository / "asked").read_text() == "check\n"
    (repository / "no").touch()
    assert git(*commit, at=repository).returncode != 0
    assert git(*commit, "--no-verify", at=repository).returncode == 0


@pytest.mark.process
def test_another_hook_is_kept_and_a_folder_without_git_is_refused(repository: Path, tmp_path: Path) -> None:
    hook = repository / ".git/hooks/pre-commit"
    hook.parent.mkdir(exist_ok=True)
    hook.write_text("#!/bin/sh\nexit 0\n")
    with pytest.raises(BadInput, match=r"exists already: add the line \./elea check to it"):
        install_pre_commit_hook(repository)
    assert hook.read_text() == "#!/bin/sh\nexit 0\n"
    hook.unlink()
    (repository / ".git").rename(repository / "gone")
    with pytest.raises(BadInput, match="is not a Git repository"):
        install_pre_commit_hook(repository)
