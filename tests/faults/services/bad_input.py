"""Exits with bad input, as it will on every restart."""

from __future__ import annotations

import sys

sys.stderr.write("the configuration is bad\n")
sys.exit(2)
