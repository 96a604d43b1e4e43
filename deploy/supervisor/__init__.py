"""The supervisor: starts the processes of a fleet in order, watches over them, and ends them without a trace."""
