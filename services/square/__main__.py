"""`python -m services.square`."""

from services.runtime.main import main
from services.square import SERVICE

main(SERVICE)
