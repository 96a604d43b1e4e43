"""A service of the user's own: the declaration in a Python file, read by loading the file without running the loop."""

from __future__ import annotations

import runpy
import sys
import traceback
from functools import cache
from pathlib import Path

from services.runtime.errors import BadInput
from services.runtime.main import Declared, declaring
from services.runtime.service import Service


def is_own(kind: str) -> bool:
    """Whether a fleet's ``kind`` is a file instead of a name."""
    return kind.endswith(".py")


@cache
def read_own(file: str) -> Service:
    """What the file hands to ``main``; raises BadInput for a file that is not there, that fails, or never calls it.

    The file is loaded in this process, with its folder on the path, as ``./elea run`` does.
    """
    path = Path(file)
    if not path.is_file():
        raise BadInput(f"there is no file {file}")
    before = list(sys.path)
    sys.path.append(str(path.parent))
    try:
        with declaring():
            runpy.run_path(file, run_name="__main__")
    except Declared as declared:
        return declared.service
    except (Exception, SystemExit) as error:  # noqa: BLE001 whatever a user's file may raise
        raise BadInput(f"{_line(path, error)}: it fails as it is loaded: {type(error).__name__}: {error}") from None
    finally:
        sys.path[:] = before
    raise BadInput(f"{file} declares no service: it never calls main(Service(...)) of services.runtime")


def _line(path: Path, error: BaseException) -> str:
    """The last place in the file that the error came through."""
    if isinstance(error, SyntaxError):
        return f"{path}:{error.lineno}"
    lines = [each.lineno for each in traceback.extract_tb(error.__traceback__) if each.filename == str(path)]
    return f"{path}:{lines[-1]}" if lines else str(path)
