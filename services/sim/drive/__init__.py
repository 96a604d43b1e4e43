"""The differential drive of a base: ROS's ``diff_drive_controller`` and the TurtleBot3's driver.

``config``      the configuration, from a model and a robot's parameters
``arbiter``     which command is obeyed: priorities, time-outs, emergency stop
``controller``  the controller of one robot: arbiter, driver and PID at each physics step
``driver``      from a velocity command to wheel speeds, a pure function
``planar_velocity``  the velocity of a holonomic base, set as it is commanded
``limiter``     jerk, acceleration and velocity limits of one axis, and the ramp of the wheels
``kinematics``  wheel separation and radii, wheel speeds and base speeds
``steering``    the wheels that a car is steered by
``odometry``    from wheel angles or commands back to a pose
``side_grip``   what keeps a base that skids from sliding sideways
``pid``         from wheel speeds to torques
"""
