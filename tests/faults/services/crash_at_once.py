"""Exits before it joins the network, for lack of a dependency."""

from __future__ import annotations

import sys

sys.stderr.write("the lidar does not answer\n")
sys.exit(1)
