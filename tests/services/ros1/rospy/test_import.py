"""The cost of ``import rospy`` for a script."""

import os
import subprocess
import sys

from services.runtime.process import ROOT
from services.script.run import SITE_PACKAGES

CODE = "import sys, rospy; print([each for each in ('numpy', 'rosbags', 'tf', 'scipy') if each in sys.modules])"


def test_plain_rospy_needs_no_numpy() -> None:
    environment = {**os.environ, "PYTHONPATH": f"{SITE_PACKAGES}{os.pathsep}{ROOT}"}
    done = subprocess.run(
        [sys.executable, "-P", "-c", CODE], env=environment, capture_output=True, text=True, timeout=120, check=True
    )
    assert done.stdout == "[]\n"
