"""The differential drive of a base: ROS's ``diff_drive_controller`` and the TurtleBot3's driver.

``config``      the configuration, from a model and a robot's parameters
``arbiter``     which command is followed: priorities, time-outs, emergency stop
``controller``  the controller of one robot: arbiter, driver and PID at each physics step
``driver``      from a velocity command to wheel speeds, a pure function
``planar_velocity``  the commanded velocity of a holonomic base, set directly
``limiter``     jerk, acceleration and velocity limits of one axis, and the ramp of the wheels
``kinematics``  wheel separation and radii, wheel speeds and base speeds
``steering``    the steered wheels of a base with Ackermann steering
``odometry``    from wheel angles or commands back to a pose
``odometry_error``  the systematic error of wheel odometry
``side_grip``   the sideways grip of a skid-steered base
"""
