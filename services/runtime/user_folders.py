"""The folders of a user's files: results, saved parameters, the list of running fleets, and the suffix for sockets.

Everything is in ELEA_HOME if that is set. Otherwise results go into the checkout and saved parameters into the
working directory if the user may write to the checkout. If not, for example with one installation for a whole class,
both go to ``elea`` in the user's data folder. The list of running fleets is in the state folder in either case (XDG
base directory specification).
"""

from __future__ import annotations

import hashlib
import os
import pwd
from collections.abc import Mapping
from pathlib import Path

from services.runtime.errors import BadInput
from services.runtime.process import ROOT

HOME_VARIABLE = "ELEA_HOME"
"""Environment variable that names the folder for all files of a user."""


def runs_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder that contains one folder for each run."""
    return (_own_folder(environment) or ROOT) / "runs"


def parameters_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder of saved parameters; relative to the working directory if the checkout is writable."""
    return (_own_folder(environment) or Path()) / "params"


def instances_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder with the list of the user's running fleets."""
    if home := elea_home(environment):
        return home / "state"
    base = environment.get("XDG_STATE_HOME", "")
    return (Path(base) if base else Path.home() / ".local" / "state") / "elea"


def elea_home(environment: Mapping[str, str] = os.environ) -> Path | None:
    """Return the folder in ELEA_HOME; None if it is not set. Raises BadInput for a relative path."""
    given = environment.get(HOME_VARIABLE, "")
    if given and not Path(given).is_absolute():
        raise BadInput(
            f"{HOME_VARIABLE} is {given!r}: give an absolute path, so that every command uses the same folder"
        )
    return Path(given) if given else None


def socket_suffix(environment: Mapping[str, str] = os.environ) -> str:
    """Return the suffix of the socket folder for the current home; empty for the account's own home.

    One account may have several homes (in containers, under ``sudo``, with ELEA_HOME); each has its own fleets.
    """
    home = environment.get(HOME_VARIABLE, "") or environment.get("HOME", "")
    try:
        account = pwd.getpwuid(os.geteuid()).pw_dir
    except KeyError:
        account = ""
    if not home or os.path.normpath(home) == os.path.normpath(account or home):
        return ""
    return f"-{hashlib.sha256(os.fsencode(os.path.normpath(home))).hexdigest()[:8]}"


def _own_folder(environment: Mapping[str, str]) -> Path | None:
    """Return the user's folder for results and parameters; None if the checkout is used."""
    if home := elea_home(environment):
        return home
    if os.access(ROOT, os.W_OK):
        return None
    base = environment.get("XDG_DATA_HOME", "")
    return (Path(base) if base else Path.home() / ".local" / "share") / "elea"
