"""`python -m services.state`."""

from services.runtime.main import main
from services.state import SERVICE

main(SERVICE)
