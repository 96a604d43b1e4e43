"""Mathematics of driving on the ground that several services use: poses, legs, profiles. It touches no bus."""
