"""`python -m services.teleop`."""

from services.runtime.main import main
from services.teleop import SERVICE

main(SERVICE)
