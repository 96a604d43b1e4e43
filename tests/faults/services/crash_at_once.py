"""Its configuration is bad: it ends before it has joined the network."""

from __future__ import annotations

import sys

sys.stderr.write("the configuration is bad\n")
sys.exit(2)
