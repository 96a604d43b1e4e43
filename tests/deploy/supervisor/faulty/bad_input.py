"""Exits because its input is wrong."""

import sys

sys.stderr.write("a: there is no file reference.csv\n")
sys.exit(2)
