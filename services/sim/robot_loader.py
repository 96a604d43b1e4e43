"""Loads robots from outside: those of the simulation's parameters, and those named in spawn requests.

Reading a robot's meshes takes up to seconds. For a request that is done in a thread, while the loop continues; the
robot is spawned when its files are read.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from messages.elea import ModelState
from messages.se3 import Pose3
from messages.simulation import SpawnModel
from models import MODELS
from models.model import read_model
from models.packages import FileAccess, PackagePath
from models.robot_cache import IMPORTED, is_imported
from models.robot_facts import read_facts
from models.robot_source import find_imported, names_file, resolve_robot, resolve_urdf_text
from models.sdf_robot import is_sdf, urdf_of_sdf
from services.runtime.errors import BadInput, EleaError, TryAgain
from services.runtime.requests import DeferredReply
from services.sim.parameters import RobotEntry

MAX_LOADING = 4
"""Maximum number of robots read at once."""

UPRIGHT = 1e-6
"""rad; a robot tilted by more is placed exactly where requested."""

Spawn = Callable[[str], ModelState]
"""Spawns a robot of the given model; raises BadInput."""


class RobotLoader:
    """Finds the files of robots for spawn requests.

    A request may name a robot of ``models/``, a robot already imported on this machine by its user
    (``RobotSource.model``), or a URDF or folder in one of ``folders`` (relative paths start from the first). Or it may
    contain a URDF or SDF as text, whose meshes are in these folders or in packages of ROS. Xacro from a request is
    never run.

    Args:
        folders: The fleet file's folder, and its packages.
        answer_in_loop: Lets the loop answer a reply between two ticks.
        log_note: Called in the loop with what was not understood of an SDF.
    """

    def __init__(
        self,
        folders: Sequence[str] = (),
        answer_in_loop: Callable[[DeferredReply[ModelState], Callable[[], ModelState]], None] | None = None,
        log_note: Callable[[str], None] | None = None,
    ) -> None:
        self._folders = tuple(map(Path, folders))
        self._answer_in_loop, self._log_note = answer_in_loop, log_note
        self._loading = 0
        self._last: threading.Thread | None = None

    def spawn(self, request: SpawnModel, spawn: Spawn) -> ModelState | DeferredReply[ModelState]:
        """Spawn the requested robot, at once if nothing has to be read.

        Raises:
            BadInput: It cannot be read or spawned.
            TryAgain: MAX_LOADING robots are already being loaded.
        """
        if request.model in MODELS and not request.urdf:
            return spawn(request.model)
        if (imported := find_imported(request.model)) is not None:
            return spawn(imported.model)
        if self._answer_in_loop is None or (not request.urdf and not names_file(request.model)):
            return spawn(self._log_notes(request, *self._load(request)))
        if self._loading >= MAX_LOADING:
            raise TryAgain(f"{MAX_LOADING} robots are already being loaded: try again later")
        self._loading += 1
        reply: DeferredReply[ModelState] = DeferredReply()
        arguments = request, spawn, reply, self._answer_in_loop, self._last
        self._last = threading.Thread(target=self._read, args=arguments, daemon=True)
        self._last.start()
        return reply

    def _read(
        self,
        request: SpawnModel,
        spawn: Spawn,
        reply: DeferredReply[ModelState],
        answer_in_loop: Callable[[DeferredReply[ModelState], Callable[[], ModelState]], None],
        previous: threading.Thread | None,
    ) -> None:
        """Read a robot in a thread, and let the loop spawn it; robots are spawned in the order of the requests."""
        model, notes, error = "", tuple[str, ...](), None
        try:
            model, notes = self._load(request)
        except EleaError as reason:
            error = reason
        except Exception as reason:  # noqa: BLE001 - what a foreign file makes a library raise is the request's error
            error = BadInput(f"the robot cannot be read: {type(reason).__name__}: {reason}")

        def answer() -> ModelState:
            self._loading -= 1
            if error is not None:
                raise error
            return spawn(self._log_notes(request, model, notes))

        if previous is not None:
            previous.join()
        answer_in_loop(reply, answer)

    def _log_notes(self, request: SpawnModel, model: str, notes: Sequence[str]) -> str:
        """Log the ``notes`` and return the model."""
        if notes and self._log_note is not None:
            self._log_note(f"{request.name}: notes on its SDF: {'; '.join(notes)}")
        return model

    def _load(self, request: SpawnModel) -> tuple[str, tuple[str, ...]]:
        """Import the robot; return its model and what was not understood. Raises BadInput."""
        packages = self._folders[1:]
        folders = (*self._folders, *PackagePath().roots())
        if request.urdf:
            access, urdf, notes = FileAccess(folders, run_xacro=False), request.urdf, tuple[str, ...]()
            if is_sdf(urdf):
                urdf, notes = urdf_of_sdf(urdf, self._folders[0] if self._folders else None, packages, access)
            return resolve_urdf_text(urdf, packages, access, _label(request.model)).model, notes
        if IMPORTED.fullmatch(request.model):
            raise BadInput(
                f"the files of {_label(request.model)} are not available here: the simulation runs on another "
                "machine, or as another user. Send a URDF without meshes, or add the robot to the fleet file there"
            )
        base = self._folders[0] if self._folders else Path.cwd()
        return resolve_robot(request.model, base, packages, access=FileAccess(folders, run_xacro=False)).model, ()


def on_the_ground(model: str, pose: Pose3, ground: float = 0.0) -> Pose3:
    """Return the root pose, corrected so that an upright imported robot stands on the ``ground`` [m].

    The root of a robot of ``models/`` is on the ground; the roots of others often are at the height of their axles, or
    a few millimetres below their wheels. A pose above that height and above the ground stays as it is.
    """
    if not is_imported(model) or read_model(model).fixed_base or max(map(abs, pose.rpy[:2])) > UPRIGHT:
        return pose
    x, y, z = pose.position
    standing = ground + read_facts(model).height
    return pose._replace(position=(x, y, z if z > max(standing, ground) else standing))


def _label(model: str) -> str:
    """Return the name of a robot whose files may not be on this machine."""
    return model.rpartition("-")[0] if IMPORTED.fullmatch(model) else model


def with_own_files(entry: RobotEntry) -> RobotEntry:
    """Import a robot of the simulation's own parameters, if it is not one of ``models/``; raises BadInput."""
    if entry.model in MODELS:
        return entry
    return msgspec.structs.replace(entry, model=resolve_robot(entry.model, Path.cwd()).model)
