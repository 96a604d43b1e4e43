"""./elea in a bare copy with fake programs on the PATH: what it installs, when, and its messages."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import pytest
from packaging.markers import Marker

from services.runtime.process import ROOT
from tests.harness.waiting import wait_until

TOOLS = ("sh", "cat", "chmod", "cksum", "dirname", "flock", "mkdir", "mv", "readlink", "rm", "sleep", "uname")

PYTHON = """#!/bin/sh
# Stands for a Python: makes an environment whose python says what it is asked.
case "$*" in
    *version_info*) exit ${OLD_PYTHON:-0} ;;
    *ensurepip*) exit ${NO_VENV:-0} ;;
    "-m venv "*)
        echo "venv" >>"$COUNT"
        [ -z "${WHO:-}" ] || echo "${0##*/}" >>"$WHO"
        mkdir -p "$3/bin"
        cat >"$3/bin/python" <<'END'
#!/bin/sh
case "$*" in
    *"-m pip install"*)
        echo "pip" >>"$COUNT"
        [ -z "${HANG:-}" ] || { echo "half" >"$HANG"; sleep 60; }
        exit ${PIP_STATUS:-0} ;;
    *find_spec*) exit ${NO_PYBULLET:-0} ;;
    *)
        echo "python $*"; echo "path $PYTHONPATH"
        [ -z "${PYTHONPYCACHEPREFIX:-}" ] ||
            echo "bytecode $PYTHONPYCACHEPREFIX${PYTHONDONTWRITEBYTECODE:+, read alone}" ;;
esac
END
        chmod +x "$3/bin/python" ;;
esac
"""

UV = """#!/bin/sh
# Stands for uv.
echo "uv $1 $2" >>"$COUNT"
case "$1 $2" in
    "venv "*) for target; do :; done; python3.11 -m venv "$target" ;;
    "pip sync") exit ${UV_STATUS:-0} ;;
esac
"""


class ProjectCopy:
    """A fresh clone, with the files that the script needs, and a PATH of its own."""

    def __init__(self, folder: Path) -> None:
        self.root, self._bin, self.count = folder / "clone", folder / "bin", folder / "count"
        self.root.mkdir()
        self._bin.mkdir()
        for name in ("elea", "pyproject.toml", "requirements.lock"):
            shutil.copy(ROOT / name, self.root / name)
        for tool in TOOLS:
            found = shutil.which(tool)
            assert found
            (self._bin / tool).symlink_to(found)

    def provide(self, name: str, script: str) -> None:
        """Put a program on the PATH."""
        (self._bin / name).write_text(script)
        (self._bin / name).chmod(0o755)

    def environment(self, **extra: str) -> dict[str, str]:
        return {"PATH": str(self._bin), "COUNT": str(self.count), **extra}

    def start(
        self,
        *arguments: str,
        script: Path | None = None,
        cwd: Path | None = None,
        extra: Mapping[str, str] = MappingProxyType({}),
    ) -> subprocess.CompletedProcess[str]:
        """Run the script from another folder, with ``extra`` in its environment."""
        return subprocess.run(
            [str(script or self.root / "elea"), *arguments],
            env=self.environment(**extra),
            cwd=cwd or self.root.parent,
            capture_output=True,
            text=True,
            timeout=180,
        )

    def installs(self) -> list[str]:
        """Return the installation steps so far, in order."""
        return self.count.read_text().split("\n")[:-1] if self.count.exists() else []


@pytest.fixture
def copy(tmp_path: Path) -> ProjectCopy:
    made = ProjectCopy(tmp_path)
    made.provide("python3.11", PYTHON)
    return made


def test_first_start_installs_and_the_second_does_not(copy: ProjectCopy) -> None:
    first = copy.start("up", "--seed", "3")
    assert first.returncode == 0
    assert first.stdout == f"python -P -m deploy up --seed 3\npath {copy.root}\n"
    assert "making .venv" in first.stderr
    second = copy.start("test")
    assert second.stdout.startswith("python -P -m deploy test\n")
    assert second.stderr == ""
    assert copy.installs() == ["venv", "pip"]


def test_completion_installs_nothing(copy: ProjectCopy) -> None:
    asked = copy.start(extra={"_ELEA_COMPLETE": "bash_complete"})
    assert (asked.returncode, asked.stdout, asked.stderr) == (0, "", "")
    assert copy.installs() == []
    copy.start()
    assert copy.start(extra={"_ELEA_COMPLETE": "bash_source"}).stdout.startswith("python -P -m deploy")


def test_bytecode_that_must_not_lie_beside_the_sources_goes_into_the_environment(copy: ProjectCopy) -> None:
    started = copy.start("ps", extra={"PYTHONDONTWRITEBYTECODE": "1"})
    assert started.stdout.endswith(f"bytecode {copy.root}/.venv/bytecode\n")
    own = copy.start("ps", extra={"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPYCACHEPREFIX": "/elsewhere"})
    assert own.stdout.endswith("bytecode /elsewhere, read alone\n")


def test_works_through_a_link_and_from_anywhere(copy: ProjectCopy, tmp_path: Path) -> None:
    (tmp_path / "links").mkdir()
    (tmp_path / "links" / "one").symlink_to("../clone/elea")
    (tmp_path / "two").symlink_to(tmp_path / "links" / "one")
    done = copy.start("ps", script=tmp_path / "two", cwd=Path("/"))
    assert done.stdout.endswith(f"path {copy.root}\n")


def test_changed_lock_installs_anew(copy: ProjectCopy) -> None:
    copy.start()
    with (copy.root / "requirements.lock").open("a") as lock:
        lock.write("# changed\n")
    copy.start()
    copy.start()
    assert copy.installs() == ["venv", "pip"] * 2


def test_moved_folder_installs_anew(copy: ProjectCopy, tmp_path: Path) -> None:
    copy.start()
    copy.root.rename(tmp_path / "moved")
    copy.start(script=tmp_path / "moved" / "elea")
    assert copy.installs() == ["venv", "pip"] * 2


def test_interrupted_install_is_made_anew_and_never_used(copy: ProjectCopy, tmp_path: Path) -> None:
    half = tmp_path / "half"
    script = subprocess.Popen(
        [copy.root / "elea", "up"],
        env=copy.environment(HANG=str(half)),
        start_new_session=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    wait_until(half.exists, 20.0, "a half of an installation")
    os.killpg(script.pid, signal.SIGKILL)
    assert script.communicate()[0] == b""
    assert (copy.root / ".venv" / "bin" / "python").exists()
    assert copy.start("up").stdout.startswith("python -P -m deploy up")
    assert copy.installs() == ["venv", "pip"] * 2


def test_installer_that_outlives_a_killed_start_is_waited_for(copy: ProjectCopy, tmp_path: Path) -> None:
    half, said = tmp_path / "half", tmp_path / "said"
    killed = subprocess.Popen(
        [copy.root / "elea", "up"],
        env=copy.environment(HANG=str(half)),
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    wait_until(half.exists, 20.0, "a half of an installation")
    killed.kill()
    killed.wait()
    with said.open("w") as stderr:
        again = subprocess.Popen(
            [copy.root / "elea", "ps"], env=copy.environment(), stdout=subprocess.PIPE, stderr=stderr
        )
        wait_until(lambda: "left of one that was killed" in said.read_text(), 20.0, "the second start to wait")
        assert copy.installs() == ["venv", "pip"]
        os.killpg(killed.pid, signal.SIGKILL)
        assert again.communicate(timeout=180)[0].startswith(b"python -P -m deploy ps")
    assert copy.installs() == ["venv", "pip"] * 2


def test_two_first_starts_install_once(copy: ProjectCopy) -> None:
    slow = PYTHON.replace('echo "pip" >>"$COUNT"', 'echo "pip" >>"$COUNT"; sleep 0.5')
    copy.provide("python3.11", slow)
    both = [
        subprocess.Popen([copy.root / "elea", "ps"], env=copy.environment(), stdout=subprocess.PIPE) for _ in range(2)
    ]
    assert [each.communicate(timeout=180)[0].split(b"\n")[0] for each in both] == [b"python -P -m deploy ps"] * 2
    assert copy.installs() == ["venv", "pip"]


def test_failed_install_is_told_and_retried(copy: ProjectCopy) -> None:
    failed = copy.start("up", extra={"PIP_STATUS": "1"})
    assert failed.returncode == 2
    assert failed.stdout == ""
    assert "is the package index reachable?" in failed.stderr
    assert copy.start("up").returncode == 0


def test_uv_comes_first(copy: ProjectCopy) -> None:
    copy.provide("uv", UV)
    assert copy.start("up").returncode == 0
    assert copy.installs() == ["uv venv --quiet", "venv", "uv pip sync"]


def test_pip_helps_where_uv_fails(copy: ProjectCopy) -> None:
    copy.provide("uv", UV)
    done = copy.start("up", extra={"UV_STATUS": "1"})
    assert done.returncode == 0
    assert "trying pip" in done.stderr
    assert copy.installs() == ["uv venv --quiet", "venv", "uv pip sync", "venv", "pip"]


@pytest.mark.parametrize(
    ("lacking", "message"),
    [
        ({"OLD_PYTHON": "1"}, "needs Python 3.11, 3.12 or 3.13: on Debian, apt install python3 python3-venv"),
        ({"NO_VENV": "1"}, "cannot make virtual environments: on Debian, apt install python3-venv"),
    ],
)
def test_what_is_missing_is_told(copy: ProjectCopy, lacking: dict[str, str], message: str) -> None:
    done = copy.start("up", extra=lacking)
    assert done.returncode == 2
    assert message in done.stderr
    assert not (copy.root / ".venv").exists()


def test_no_python_at_all(tmp_path: Path) -> None:
    done = ProjectCopy(tmp_path).start("up")
    assert done.returncode == 2
    assert "needs Python 3.11" in done.stderr


def test_python_311_comes_first_then_any_that_the_lock_holds_for(tmp_path: Path) -> None:
    for number, (there, chosen) in enumerate(
        {
            ("python3.11", "python3.13", "python3"): "python3.11",
            ("python3.12", "python3.13"): "python3.12",
            ("python3.13", "python3"): "python3.13",
            ("python3",): "python3",
        }.items()
    ):
        folder = tmp_path / str(number)
        folder.mkdir()
        copy = ProjectCopy(folder)
        for name in there:
            copy.provide(name, PYTHON)
        assert copy.start("up", extra={"WHO": str(folder / "who")}).returncode == 0
        assert (folder / "who").read_text() == f"{chosen}\n", there


def test_a_python_without_a_package_of_pybullet_is_told_once(copy: ProjectCopy) -> None:
    line = "elea: the physics engine is MuJoCo: PyBullet has packages only for Python 3.11 on x86_64\n"
    assert copy.start("up", extra={"NO_PYBULLET": "1"}).stderr.endswith(line)
    assert copy.start("up", extra={"NO_PYBULLET": "1"}).stderr == ""


def test_uv_takes_another_python_where_it_can_bring_no_311(copy: ProjectCopy) -> None:
    copy.provide(
        "uv",
        """#!/bin/sh
case "$*" in
    "venv "*" 3.11 "*) exit 1 ;;
    "venv "*">=3.11,<3.14"*) for target; do :; done; echo "any" >>"$COUNT"; python3.11 -m venv "$target" ;;
esac
""",
    )
    assert copy.start("up").returncode == 0
    assert copy.installs() == ["any", "venv"]


def installed_packages(python: str, machine: str) -> set[str]:
    """Return the names of the packages that the lock installs on Linux, by its markers."""
    system = {"sys_platform": "linux", "platform_system": "Linux", "platform_machine": machine}
    own = {**system, "python_version": python, "python_full_version": f"{python}.1"}
    lock = (ROOT / "requirements.lock").read_text()
    pinned = re.findall(r"^([\w.-]+)==[^\s;]+(?: ; (.+?))? \\$", lock, re.MULTILINE)
    return {name for name, marker in pinned if not marker or Marker(marker).evaluate(own)}


def test_the_lock_holds_for_every_python_and_machine() -> None:
    machines = [(f"3.{minor}", machine) for minor in (11, 12, 13) for machine in ("x86_64", "aarch64")]
    found = {each: installed_packages(*each) for each in machines}
    everywhere = set.intersection(*map(set, found.values()))
    assert {"eclipse-zenoh", "mujoco-core", "rerun-sdk", "numpy", "msgspec", "fissix"} <= everywhere
    assert [each for each in machines if "pybullet" in found[each]] == [("3.11", "x86_64")]
