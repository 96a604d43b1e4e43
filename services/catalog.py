"""Service declarations, loaded without running the services: of this folder, of user Python files, of ROS scripts."""

from __future__ import annotations

import importlib
import sys
from functools import cache
from pathlib import Path

from services.runtime.errors import BadInput, unknown_name
from services.runtime.service import Service, load_user_service
from services.script.inspect_script import Api, inspect_script, legal_node_name

_FOLDER = Path(__file__).parent

SCRIPT_RATE = 100.0
"""Rate [Hz] at which a script follows simulation time: its sleeps end at the first of these ticks."""

NO_ROS2 = "ROS 2 programs are not supported yet, ROS 1 programs (rospy) are; services.runtime is Elea's own API"
"""Error text for a file that uses rclpy."""


@cache
def service_kinds() -> tuple[str, ...]:
    """Return the names of all services: the folders beside this file that contain ``loop.py``."""
    return tuple(sorted(each.parent.name for each in _FOLDER.glob("*/loop.py")))


def load_named_service(kind: str, where: str = "") -> Service:
    """Load the declaration of a service; raises BadInput, with the nearest name, prefixed by the place ``where``."""
    if kind not in service_kinds():
        raise unknown_name("service", kind, service_kinds(), where)
    service = importlib.import_module(f"services.{kind}").SERVICE
    if not isinstance(service, Service):
        raise TypeError(f"services.{kind}.SERVICE is not a Service")
    return service


def is_user_file(kind: str) -> bool:
    """Whether a fleet's ``kind`` is a file rather than a service name: it ends in .py or contains a slash, since ROS
    scripts may lack the suffix."""
    return kind.endswith(".py") or "/" in kind


def is_script(kind: str) -> bool:
    """Whether a fleet's ``kind`` is a ROS 1 program, which ``services.script`` runs."""
    return is_user_file(kind) and script_api(kind) == "ros1"


def script_api(file: str) -> Api:
    """Return the ROS API that a Python file uses; "" for a service of our own. Raises BadInput."""
    return _script_service(file)[0]


def load_service(kind: str, where: str = "") -> Service:
    """Load the declaration of a service, of one in a user's Python file, or for a ROS script, derived from its text.

    Raises BadInput, with the nearest name, prefixed by the place ``where``.
    """
    if is_user_file(kind):
        try:
            api, script = _script_service(kind)
            if api == "ros2":
                raise BadInput(f"{kind} is written for ROS 2 (rclpy): {NO_ROS2}")
            return script if api == "ros1" else load_user_service(kind)
        except BadInput as error:
            raise BadInput(f"{where}: {error}" if where else str(error)) from None
    return load_named_service(kind, where)


def load_component(kind: str) -> Service:
    """Load the service of a node in a shared process; adds a user file's folder to ``sys.path``. Raises BadInput."""
    service = load_service(kind)
    if is_script(kind):
        raise BadInput(f"{kind} is a ROS 1 program: it needs its own process")
    if is_user_file(kind) and (folder := str(Path(kind).resolve().parent)) not in sys.path:
        sys.path.append(folder)
    return service


@cache
def _script_service(file: str) -> tuple[Api, Service]:
    path = Path(file)
    facts = inspect_script(path)
    name = facts.node_name or legal_node_name(path.stem) or "script"
    about = f"The ROS 1 program {path.name}."
    return facts.api, Service(name=name, about=about, run="services.script.__main__:run", rate=SCRIPT_RATE)
