"""The controller manager: ROS's controllers for the joints of one robot, configured by ros_control's YAML files."""

from __future__ import annotations

from services.runtime import Parameters, Service, param


class ControllerManagerParameters(Parameters, frozen=True, kw_only=True):
    """Parameters of the controller manager. Gains are in separate sets, ``CONTROLLER/pid`` or
    ``CONTROLLER/gains/JOINT``."""

    config: str = param(
        "",
        text="YAML file of the controllers, in a fleet relative to the fleet file; or its content, in braces.",
        max_length=65536,
        live=False,
    )
    robot: str = param(
        "", text="Name of the robot in the simulation; the namespace's if empty.", max_length=255, live=False
    )
    controllers: tuple[str, ...] = param(
        (),
        text="Controllers to start; if empty, all in the order of the file whose joints are not claimed yet.",
        max_length=100,
        live=False,
    )
    update_rate: float = param(
        0.0,
        0,
        200,
        "Hz",
        "Control rate; in lockstep, its period is a whole number of physics steps. 0: the file's rate, else 100 Hz.",
        live=False,
    )
    duration: float = param(
        0.1, 0.02, 1, "s", "How long joints follow a command unless another arrives; at least two control periods."
    )
    state_timeout: float = param(0.1, 0.02, 1, "s", "Stop commanding when no joint states have arrived for this long.")
    command_timeout: float = param(
        0.0,
        0,
        60,
        "s",
        "Stop joints without a new velocity or effort command for this long; 0, as in ROS, disables it.",
    )


SERVICE = Service(
    name="controller_manager",
    about="Runs ROS's joint and trajectory controllers for one robot, from the YAML file of ros_control.",
    run="services.controller_manager.loop:run",
    rate=100,
    parameters=ControllerManagerParameters,
)
