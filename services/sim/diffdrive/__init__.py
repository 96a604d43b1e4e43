"""A two-wheeled base as mathematics: ROS's ``diff_drive_controller`` and the TurtleBot3's driver, numbers in and out.

``limiter``   jerk, acceleration and velocity limits of one axis
``ramp``      the wheels' own ramp, as the TurtleBot3's plugin has it
``geometry``  wheel separation and radii with their multipliers, and what wrong figures do
``driver``    the three together: from a command to wheel speeds, once per physics step
``odometry``  from wheel angles or commands back to a pose
``pid``       from wheel speeds to torques
``live``      what may change while the base drives

``services/sim/base/settings.py`` makes these records from parameters, ``services/sim/base/base.py`` runs them.
"""
