"""The service that a Python file of the user declares: what it hands to ``main``, without running it."""

from __future__ import annotations

import runpy
import sys
import traceback
from contextvars import ContextVar
from functools import cache
from pathlib import Path

from services.runtime.errors import BadInput
from services.runtime.service import Service

_loading = ContextVar("loading", default=False)


class ServiceCaptured(BaseException):
    """Raised by ``main`` while a file is loaded, with the service that it would run.

    No ``except Exception`` of the file stops it.
    """

    def __init__(self, service: Service) -> None:
        super().__init__(service.name)
        self.service = service


def capture(service: Service) -> None:
    """Raise ServiceCaptured if a file is being loaded for its declaration."""
    if _loading.get():
        raise ServiceCaptured(service)


@cache
def load_user_service(file: str) -> Service:
    """What the file hands to ``main``; raises BadInput for a file that is not there, that fails, or never calls it.

    The file is loaded in this process, with its folder on the path, as ``./elea run`` does.
    """
    path = Path(file)
    if not path.is_file():
        raise BadInput(f"there is no file {file}")
    before, token = list(sys.path), _loading.set(True)
    sys.path.append(str(path.parent))
    try:
        runpy.run_path(file, run_name="__main__")
    except ServiceCaptured as declared:
        return declared.service
    except (Exception, SystemExit) as error:  # noqa: BLE001 whatever a user's file may raise
        raise BadInput(f"{_error_line(path, error)}: it fails to load: {type(error).__name__}: {error}") from None
    finally:
        _loading.reset(token)
        sys.path[:] = before
    raise BadInput(f"{file} declares no service: it never calls main of services.runtime")


def _error_line(path: Path, error: BaseException) -> str:
    """The last place in the file that the error came through."""
    if isinstance(error, SyntaxError):
        return f"{path}:{error.lineno}"
    lines = [each.lineno for each in traceback.extract_tb(error.__traceback__) if each.filename == str(path)]
    return f"{path}:{lines[-1]}" if lines else str(path)
