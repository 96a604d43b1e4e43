"""Was given what cannot be right."""

import sys

sys.stderr.write("a: there is no file reference.csv\n")
sys.exit(2)
