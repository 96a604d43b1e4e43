"""``python -m deploy``, which ``./elea`` runs."""

from deploy.commands.cli import main

main()
