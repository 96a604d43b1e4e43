"""What a robot's sensors and odometry read."""
