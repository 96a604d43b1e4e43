"""Its configuration is bad, and will be when it is started again."""

from __future__ import annotations

import sys

sys.stderr.write("the configuration is bad\n")
sys.exit(2)
