"""The teleop service: drives a robot from the keyboard, with the keys and options of teleop_twist_keyboard."""

from __future__ import annotations

from messages.geometry import FASTEST_ANGULAR, FASTEST_LINEAR
from services.runtime import Parameters, Service, param

MIN_SPEED = 1e-3
"""Minimum speed [m/s, rad/s] that scaling can reach, so that it can always scale up again."""


class TeleopParameters(Parameters):
    """Parameters of teleop. The first eight are those of teleop_twist_keyboard."""

    speed: float = param(0.5, MIN_SPEED, FASTEST_LINEAR, "m/s", "Initial linear speed.")
    turn: float = param(1.0, MIN_SPEED, FASTEST_ANGULAR, "rad/s", "Initial turn rate.")
    speed_limit: float = param(
        FASTEST_LINEAR, MIN_SPEED, FASTEST_LINEAR, "m/s", "Maximum linear speed that scaling can reach."
    )
    turn_limit: float = param(
        FASTEST_ANGULAR, MIN_SPEED, FASTEST_ANGULAR, "rad/s", "Maximum turn rate that scaling can reach."
    )
    repeat_rate: float = param(20.0, 0, 200, "Hz", "Rate of commands while a key is held; 0 sends only on key events.")
    key_timeout: float = param(
        0.6, 0.05, 5, "s", "How long a key counts as held after its first event; more than the keyboard's delay."
    )
    stamped: bool = param(False, text="Publish TwistStamped instead of Twist.", live=False)
    frame_id: str = param("", text="Frame in the header of a TwistStamped.", max_length=255, live=False)
    adaptive: bool = param(
        True, text="Learn the keyboard's delay and interval; otherwise wait key_timeout after each event."
    )
    give_way: float = param(
        3.0, 0.3, 60, "s", "Simulation time for which zero is sent after the last key, before others may drive."
    )
    keys: str = param(
        "",
        text="Script of keys to play, as KEY@FROM[-TO] in seconds, e.g. 'i@0.5-2 k@2.5'.",
        max_length=10_000,
        live=False,
    )
    key_delay: float = param(0.5, 0.01, 5, "s", "Delay before the first repeat of a scripted key.", live=False)
    key_interval: float = param(0.03, 0.005, 1, "s", "Interval between repeats of a scripted key.", live=False)


SERVICE = Service(
    name="teleop",
    about="Drives a robot from the keyboard, or from a script of keys.",
    run="services.teleop.loop:run",
    rate=50,
    parameters=TeleopParameters,
    alone="it reads the keyboard",
)
