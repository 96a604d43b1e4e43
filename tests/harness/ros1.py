"""Imports the ROS 1 libraries in a test and unloads them afterwards."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from messages.interfaces import catalogue
from services.script.interface_finder import install
from services.script.kernel import ScriptKernel
from services.script.loader import SITE_PACKAGES
from tests.harness.memory_kernel import memory_kernel


@contextmanager
def ros1_imports(simulated: bool = False) -> Iterator[ScriptKernel]:
    """Make ``import rospy`` and other ROS 1 imports find Elea's libraries, on an in-memory kernel, during the block."""
    known, path, finders = set(sys.modules), list(sys.path), list(sys.meta_path)
    handlers = list(logging.getLogger("rosout").handlers)
    sys.path.insert(0, str(SITE_PACKAGES))
    catalogue.cache_clear()  # interfaces that another test added
    install(catalogue(), lambda name: None)
    try:
        with memory_kernel(simulated=simulated) as kernel:
            yield kernel
    finally:
        sys.path[:], sys.meta_path[:] = path, finders
        logging.getLogger("rosout").handlers[:] = handlers
        catalogue.cache_clear()
        for name, module in list(sys.modules.items()):
            home = getattr(module, "__file__", None) or ""
            if name not in known and (home.startswith(str(SITE_PACKAGES)) or not home):
                del sys.modules[name]
