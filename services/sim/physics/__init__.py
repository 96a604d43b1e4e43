"""The physics engine: ``World``, a Protocol, and its implementations in PyBullet and in MuJoCo."""
