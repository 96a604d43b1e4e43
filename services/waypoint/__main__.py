"""`python -m services.waypoint`."""

from services.runtime.main import main
from services.waypoint import SERVICE

main(SERVICE)
