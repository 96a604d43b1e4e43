"""The nodes' library."""
