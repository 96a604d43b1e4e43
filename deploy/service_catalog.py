"""The declarations of services: those that exist, and those in Python files of the user, without running them."""

from __future__ import annotations

import runpy
import sys
import traceback
from functools import cache
from pathlib import Path

from services.catalog import load_named_service
from services.runtime.errors import BadInput
from services.runtime.main import ServiceCaptured, capture_service
from services.runtime.service import Service


def is_user_file(kind: str) -> bool:
    """Whether a fleet's ``kind`` is a file instead of a name."""
    return kind.endswith(".py")


@cache
def load_user_service(file: str) -> Service:
    """What the file hands to ``main``; raises BadInput for a file that is not there, that fails, or never calls it.

    The file is loaded in this process, with its folder on the path, as ``./elea run`` does.
    """
    path = Path(file)
    if not path.is_file():
        raise BadInput(f"there is no file {file}")
    before = list(sys.path)
    sys.path.append(str(path.parent))
    try:
        with capture_service():
            runpy.run_path(file, run_name="__main__")
    except ServiceCaptured as declared:
        return declared.service
    except (Exception, SystemExit) as error:  # noqa: BLE001 whatever a user's file may raise
        raise BadInput(f"{_error_line(path, error)}: it fails to load: {type(error).__name__}: {error}") from None
    finally:
        sys.path[:] = before
    raise BadInput(f"{file} declares no service: it never calls main(Service(...)) of services.runtime")


def _error_line(path: Path, error: BaseException) -> str:
    """The last place in the file that the error came through."""
    if isinstance(error, SyntaxError):
        return f"{path}:{error.lineno}"
    lines = [each.lineno for each in traceback.extract_tb(error.__traceback__) if each.filename == str(path)]
    return f"{path}:{lines[-1]}" if lines else str(path)


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
