"""The services that exist, and their declarations, without loading what they run on."""

from __future__ import annotations

import importlib
from pathlib import Path

import services
from deploy.own_service import is_own, read_own
from services.runtime.errors import BadInput, unknown
from services.runtime.service import Service

_FOLDER = Path(str(services.__file__)).parent


def kinds() -> tuple[str, ...]:
    """The names of all services: the folders of ``services`` that can be run."""
    return tuple(sorted(each.parent.name for each in _FOLDER.glob("*/__main__.py")))


def declaration(kind: str, where: str = "") -> Service:
    """The declaration of a service, or of that in a Python file of the user's own.

    Raises BadInput, with the nearest name, behind the place ``where``.
    """
    if is_own(kind):
        try:
            return read_own(kind)
        except BadInput as error:
            raise BadInput(f"{where}: {error}" if where else str(error)) from None
    if kind not in kinds():
        raise unknown("service", kind, kinds(), where)
    service = importlib.import_module(f"services.{kind}").SERVICE
    if not isinstance(service, Service):
        raise TypeError(f"services.{kind}.SERVICE is not a Service")
    return service
