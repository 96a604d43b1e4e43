"""Efforts on joints and wrenches on bodies as jobs in simulation time, as Gazebo's world services took them."""
