"""A service's parameters: the record with its bounds, and how it follows the parameter service."""
