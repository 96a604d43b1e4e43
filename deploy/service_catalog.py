"""The declarations of services: those that exist, and those in Python files of the user, without running them."""

from __future__ import annotations

from services.catalog import load_named_service
from services.runtime.errors import BadInput
from services.runtime.service import Service
from services.runtime.service_file import load_user_service


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
