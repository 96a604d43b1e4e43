"""Each import contract detects a planted violation; ``test_static`` checks that they hold in this tree."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import grimp
import pytest

from services.runtime.process import ROOT
from tests.harness.cases import case

LINT = "import sys; from importlinter.cli import lint_imports_command as lint; lint()"

LAYERS = "Data flows one way: deploy, services, models, then messages"
SERVICES = "Services stand on the runtime and never import each other"
RUNTIME = "The runtime is built in layers, from the errors up to the command line"
COMMANDS = "Nothing below the command line imports it"
VOCABULARY = "Messages import no network, physics, viewer or arrays"
NETWORK = "Zenoh stands behind the transport alone"
PHYSICS = "PyBullet stands behind the world of the simulation alone"
MUJOCO = "MuJoCo stands behind the world of the simulation alone"
VIEWER = "Rerun stands behind the logger alone"
BAGS = "MCAP stands behind the bags alone"
WEB = "The web server stands behind the panel alone"

PLANTED = [
    (LAYERS, "services/waypoint/controller.py", "from deploy import VERSION"),
    (LAYERS, "messages/names.py", "from services.runtime.errors import BadInput"),
    (LAYERS, "models/urdf.py", "from services.runtime.errors import BadInput"),
    (LAYERS, "messages/std.py", "from models import model_path"),
    (SERVICES, "services/waypoint/controller.py", "from services.sim.drive.driver import advance"),
    (SERVICES, "services/grader/measurement.py", "from services.waypoint import controller"),
    (SERVICES, "services/runtime/context.py", "from services.sim import STEP_NS"),
    (RUNTIME, "services/runtime/node.py", "from services.runtime.parameters.client import ParameterClient"),
    (COMMANDS, "deploy/live/echo.py", "from deploy.commands.options import json_option"),
    (COMMANDS, "deploy/doctor/checks.py", "def later(): from deploy.commands.cli import main"),
    (VOCABULARY, "messages/sensor.py", "import numpy"),
    (VOCABULARY, "messages/topics.py", "def later(): import zenoh"),
    (VOCABULARY, "messages/geometry.py", "import pybullet"),
    (VOCABULARY, "messages/nav.py", "import rerun"),
    (NETWORK, "services/runtime/node.py", "import zenoh"),
    (NETWORK, "services/grader/loop.py", "def later(): import zenoh"),
    (NETWORK, "deploy/live/connect.py", "from zenoh import Config"),
    (PHYSICS, "services/grader/loop.py", "import pybullet"),
    (PHYSICS, "services/sim/robot.py", "import pybullet"),
    (PHYSICS, "models/world.py", "import pybullet_data"),
    (MUJOCO, "services/sim/engines.py", "import mujoco"),
    (VIEWER, "services/sim/loop.py", "import rerun"),
    (VIEWER, "deploy/report/picture.py", "import rerun_cli"),
    (SERVICES, "services/bag/info.py", "from services.recorder import SERVICE"),
    (BAGS, "services/recorder/bag_recorder.py", "from mcap.records import Schema"),
    (BAGS, "deploy/commands/bag.py", "def later(): import zstandard"),
    (WEB, "services/runtime/node.py", "import uvicorn"),
    (WEB, "deploy/commands/panel.py", "def later(): from starlette.routing import Route"),
    (WEB, "services/grader/loop.py", "import websockets"),
]
"""Contract, file, and the line that breaks it when appended."""


def lint(tree: Path) -> tuple[int, list[str], dict[str, str]]:
    """Run the linter in ``tree``; return its exit status, the broken contracts, and its messages by contract."""
    ran = subprocess.run(
        [sys.executable, "-P", "-c", LINT, "--no-cache", "--no-logo", "--config", ".importlinter"],
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(tree), "COLUMNS": "200"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    summary, _, details = ran.stdout.partition("Broken contracts")
    assert "Contracts:" in summary, ran.stdout + ran.stderr
    broken = [line.rpartition(" BROKEN")[0] for line in summary.splitlines() if " BROKEN" in line]
    titled = re.split(rf"^({'|'.join(map(re.escape, broken))})\n-+\n", details, flags=re.MULTILINE) if broken else []
    return ran.returncode, broken, dict(zip(titled[1::2], titled[2::2], strict=True))


def _module(file: str) -> str:
    return file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the contracts and the four packages, to plant violations in."""
    for package in ("deploy", "services", "messages", "models"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / ".importlinter", tmp_path)
    return tmp_path


def test_planted_violations_break_their_contracts(copy: Path) -> None:
    """All violations are in one tree; the linter names each file under the contract that it breaks."""
    for _, file, line in PLANTED:
        spoilt = copy / file
        assert spoilt.is_file(), file
        with spoilt.open("a") as out:
            out.write(f"\n{line}\n")
    status, broken, complaints = lint(copy)
    assert status != 0
    assert set(broken) == {contract for contract, _, _ in PLANTED}
    for contract, file, line in PLANTED:
        with case(file, line):
            assert _module(file) in complaints[contract]


def test_a_service_that_no_contract_lists_breaks_one(copy: Path) -> None:
    (copy / "services/newcomer").mkdir()
    (copy / "services/newcomer/__init__.py").write_text("SERVICE = None\n")
    status, broken, complaints = lint(copy)
    assert status != 0
    assert broken == [SERVICES]
    assert "newcomer" in complaints[SERVICES]


def test_every_contract_is_planted_against() -> None:
    stated = {line.partition("=")[2].strip() for line in _config() if line.startswith("name =")}
    assert stated == {contract for contract, _, _ in PLANTED}


def test_no_imports_form_a_circle() -> None:
    """Including imports for types only: each module can be understood after those that it imports."""
    graph = grimp.build_graph("deploy", "services", "messages", "models", cache_dir=None)
    TopologicalSorter({each: graph.find_modules_directly_imported_by(each) for each in graph.modules}).prepare()


def _config() -> list[str]:
    return (ROOT / ".importlinter").read_text().splitlines()
