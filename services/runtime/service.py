"""The declaration of a service (name, loop, rate, parameters), and the loader of declarations in users' files."""

from __future__ import annotations

import importlib
import runpy
import sys
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal, get_type_hints

import msgspec

from services.runtime.errors import BadInput, missing_file
from services.runtime.parameters.base import Parameters

Run = Callable[[Any], None]
"""The loop of a service; its argument is the Context, with the service's parameters."""

Role = Literal["member", "observer", "free", "router"]
"""A service's role in simulation time.

member: in lockstep, the simulation waits for it at each of its ticks.
observer: in lockstep, the simulation waits only for its snapshot, and at its next tick if it is still busy then.
free: the simulation never waits for it.
router: the router, which all others join.
"""

_ALONE: dict[Role, str] = {
    "observer": "the simulation goes on while it works on its last tick",
    "free": "the simulation never waits for it",
    "router": "all others join it",
}
"""Why a service of this role needs a process of its own."""


@dataclass(frozen=True, kw_only=True)
class Service:
    """The declaration of one kind of process.

    Args:
        name: the kind, and the default name of its node.
        about: one line for the help.
        run: the loop, or ``"package.module:function"`` to import it late.
        rate: rate of ``Context.ticks`` [Hz, in simulation time]; None for a service that paces itself.
        parameters: the record of its parameters.
        parameter_set: name of its parameter set, absolute or relative to its namespace; by default that of the node.
            Several services may share one set. None if its parameters never change at run time.
        role: its role in simulation time.
        rate_parameter: the parameter that replaces ``rate``, if there is one.
        alone: why its node cannot share a process with others, for a reason besides its role; empty if it can.
    """

    name: str
    about: str
    run: Run | str
    rate: float | None = None
    parameters: type[Parameters] = Parameters
    parameter_set: str | None = ""
    role: Role = "member"
    rate_parameter: str = ""
    alone: str = ""

    @property
    def reason_alone(self) -> str:
        """Why its node cannot share a process with others; empty if it can."""
        return self.alone or _ALONE.get(self.role, "")

    @property
    def steps(self) -> bool:
        """Whether it takes part in lockstep, as a member or an observer."""
        return self.role in ("member", "observer") and self.rate is not None

    def entry(self) -> Run:
        """Return the loop, importing it now if ``run`` is ``"package.module:function"``."""
        if callable(self.run):
            return self.run
        module, _, function = self.run.partition(":")
        entry: Run = getattr(importlib.import_module(module), function)
        return entry


_loading = ContextVar("loading", default=False)


class ServiceCaptured(BaseException):
    """Raised by ``main`` while a file is loaded for its declaration, with the service that it would run.

    Not an Exception, so that the file's ``except Exception`` does not catch it.
    """

    def __init__(self, service: Service) -> None:
        super().__init__(service.name)
        self.service = service


def capture(service: Service) -> None:
    """Raise ServiceCaptured if a file is being loaded for its declaration."""
    if _loading.get():
        _resolve_hints(vars(sys.modules["__main__"]))
        raise ServiceCaptured(service)


def _resolve_hints(namespace: Mapping[str, Any], prefix: str = "") -> None:
    """Replace type hints that are texts in the records of the file being loaded: its module, where their names are
    found, is ``__main__`` only now. ``prefix`` precedes the names of the namespace, that of a class within a class.
    """
    for name, record in tuple(namespace.items()):
        if not isinstance(record, msgspec.StructMeta) or record.__module__ != "__main__":
            continue
        if record.__qualname__ != prefix + name:
            continue  # another name of a record, which has its turn
        with suppress(NameError, AttributeError, SyntaxError, TypeError):  # an error only where the record is used
            hints = get_type_hints(record, include_extras=True)
            record.__annotations__ = {field: hints[field] for field in vars(record).get("__annotations__", {})}
        _resolve_hints(vars(record), f"{prefix}{name}.")


@cache
def load_user_service(file: str) -> Service:
    """Return the service that a file passes to ``main``.

    The file is loaded in this process, with its folder on the path, as by ``./elea run``.

    Raises:
        BadInput: The file does not exist, fails to load, or never calls ``main``.
    """
    path = Path(file)
    if not path.is_file():
        raise missing_file(path)
    before, token = list(sys.path), _loading.set(True)
    sys.path.append(str(path.parent))
    try:
        runpy.run_path(file, run_name="__main__")
    except ServiceCaptured as declared:
        return declared.service
    except BadInput as error:
        raise BadInput(f"{_error_line(path, error)}: {error}") from None
    except (Exception, SystemExit) as error:  # noqa: BLE001 whatever a user's file may raise
        raise BadInput(f"{_error_line(path, error)}: it fails to load: {type(error).__name__}: {error}") from None
    finally:
        _loading.reset(token)
        sys.path[:] = before
    raise BadInput(f"{file} declares no service: it never calls main of services.runtime")


def _error_line(path: Path, error: BaseException) -> str:
    """Return ``file:line`` of the last frame of the error's traceback in the file."""
    if isinstance(error, SyntaxError):
        return f"{path}:{error.lineno}"
    lines = [each.lineno for each in traceback.extract_tb(error.__traceback__) if each.filename == str(path)]
    return f"{path}:{lines[-1]}" if lines else str(path)
