"""The file of saved parameters and who holds it; tests/system/test_live_parameters.py has two fleets on one."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

import pytest

from deploy.instance_lock import check_parameter_file_unused
from services.runtime.errors import BadInput


def test_one_that_is_free_or_not_there_yet_is_taken(tmp_path: Path) -> None:
    check_parameter_file_unused(tmp_path / "new.db")
    (tmp_path / "old.db").touch()
    check_parameter_file_unused(tmp_path / "old.db")


@pytest.mark.slow
def test_one_that_another_parameter_service_holds_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "held.db"
    descriptor = os.open(file, os.O_RDWR | os.O_CREAT)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        with pytest.raises(BadInput, match=r"another parameter service uses .*held\.db.*--params FILE, or --no-saved"):
            check_parameter_file_unused(file)
    finally:
        os.close(descriptor)
    check_parameter_file_unused(file)
