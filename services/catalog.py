"""The declarations of services, without running them: of this folder, and of Python files of the user."""

from __future__ import annotations

import importlib
from pathlib import Path

from services.runtime.errors import BadInput, unknown_name
from services.runtime.service import Service, load_user_service

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


def is_user_file(kind: str) -> bool:
    """Whether a fleet's ``kind`` is a file instead of a name."""
    return kind.endswith(".py")


def load_service(kind: str, where: str = "") -> Service:
    """The declaration of a service, or of that in a Python file of the user's own.

    Raises BadInput, with the nearest name, behind the place ``where``.
    """
    if is_user_file(kind):
        try:
            return load_user_service(kind)
        except BadInput as error:
            raise BadInput(f"{where}: {error}" if where else str(error)) from None
    return load_named_service(kind, where)
