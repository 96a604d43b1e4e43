"""Lacks a dependency: it exits before it has joined the network."""

from __future__ import annotations

import sys

sys.stderr.write("the lidar does not answer\n")
sys.exit(1)
