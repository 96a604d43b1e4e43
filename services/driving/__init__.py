"""Mathematics of driving on the ground, shared by several services and independent of the bus."""
