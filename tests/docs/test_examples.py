"""The code accepts the Python examples of docs/."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import pytest

from deploy.fleet_file import read_fleet
from deploy.parameter_sets import parameter_sets
from messages.base import Message
from messages.std import Float32
from messages.topics import CMD_VEL
from services.catalog import load_user_service
from services.controller_manager.config import TYPES
from services.runtime.parameters.validation import describe_parameters
from services.runtime.testing import run_service
from tests.docs.readme import DOCS, blocks


def test_the_topic_and_the_record_can_be_declared() -> None:
    topic, record = blocks("python", (DOCS / "topics.md").read_text())
    names: dict[str, Any] = {}
    exec(topic, names)
    exec(record, names)
    assert names["BATTERY"].record is Float32
    assert issubclass(names["BatteryState"], Message)
    assert names["BatteryState"]().voltage == 0.0


def test_a_controller_publishes_on_the_topic_of_a_file_beside_it(tmp_path: Path) -> None:
    topic, _ = blocks("python", (DOCS / "topics.md").read_text())
    (tmp_path / "battery.py").write_text(topic)
    (tmp_path / "sender.py").write_text(
        "from battery import BATTERY\nfrom services.runtime import Float32, main\n\n\ndef run(ctx):\n"
        "    for _ in ctx.ticks():\n        ctx.publish(BATTERY, Float32(data=12.6))\n\n\n"
        'main(run, name="sender", about="Publishes the charge.", rate=1)\n'
    )
    names: dict[str, Any] = {}
    exec(topic, names)
    with run_service(load_user_service(str(tmp_path / "sender.py")), "/r") as sender:
        sender.set_time(1.0)
        assert math.isclose(sender.next(names["BATTERY"]).data, 12.6, rel_tol=1e-6)


def test_the_service_with_a_parameter_runs_by_it(tmp_path: Path) -> None:
    text = (DOCS / "parameters.md").read_text()
    [program] = blocks("python", text)
    assert "save it as `spin.py`" in text
    (tmp_path / "spin.py").write_text(program)
    service = load_user_service(str(tmp_path / "spin.py"))
    [speed] = describe_parameters(service.parameters)
    assert (speed.name, speed.low, speed.high, speed.unit) == ("speed", -2, 2, "rad/s")
    with run_service(service, "/r", {"speed": 1.5}) as spinning:
        spinning.set_time(0.04)
        assert math.isclose(spinning.next(CMD_VEL).angular.z, 1.5)


def test_the_controllers_and_their_fleet_are_read(tmp_path: Path) -> None:
    page = (DOCS / "controllers.md").read_text()
    [controllers] = blocks("yaml", page)
    [fleet] = blocks("toml", page)
    (tmp_path / "controllers.yaml").write_text(controllers)
    (tmp_path / "arm.toml").write_text(fleet)
    assert "/arm/controller_manager" in parameter_sets(read_fleet(tmp_path / "arm.toml"))
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    table = "".join(rows).replace("…/JointV", "effort_controllers/JointV")
    assert set(re.findall(r"`(\w+/\w+(?:Controller|Broadcaster))`", table)) == set(TYPES)


def test_the_loop_in_memory_runs(capsys: pytest.CaptureFixture[str]) -> None:
    [program] = blocks("python", (DOCS / "debugging.md").read_text())
    exec(program, {})
    assert capsys.readouterr().out.startswith("Twist(linear=Vector3(x=")
