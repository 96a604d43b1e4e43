"""The physics engine: ``World``, a Protocol, and its implementation in PyBullet."""
