"""The services that exist: their names and declarations, without running them."""

from __future__ import annotations

import importlib
from pathlib import Path

from services.runtime.errors import unknown_name
from services.runtime.service import Service

_FOLDER = Path(__file__).parent


def service_kinds() -> tuple[str, ...]:
    """The names of all services: the folders beside this file that have a loop."""
    return tuple(sorted(each.parent.name for each in _FOLDER.glob("*/loop.py")))


def load_named_service(kind: str, where: str = "") -> Service:
    """The declaration of a service; raises BadInput, with the nearest name, behind the place ``where``."""
    if kind not in service_kinds():
        raise unknown_name("service", kind, service_kinds(), where)
    service = importlib.import_module(f"services.{kind}").SERVICE
    if not isinstance(service, Service):
        raise TypeError(f"services.{kind}.SERVICE is not a Service")
    return service
