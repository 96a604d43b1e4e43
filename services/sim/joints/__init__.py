"""The joints of a robot: effort controller, jobs in simulation time, and wrenches on links, as in Gazebo."""
