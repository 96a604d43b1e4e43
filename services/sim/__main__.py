"""``python -m services.sim``."""

from services.runtime import main
from services.sim import SERVICE

main(SERVICE)
