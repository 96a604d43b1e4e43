"""The teleop service: a person drives a robot from the keyboard; keys, speeds and options of teleop_twist_keyboard."""

from __future__ import annotations

from messages.geometry import FASTEST_ANGULAR, FASTEST_LINEAR
from services.runtime import Parameters, Service, param

MIN_SPEED = 1e-3
"""m/s and rad/s; scaling goes no lower, so that it can always go up again."""


class TeleopParameters(Parameters, frozen=True, kw_only=True):
    """Speeds, limits, and how a key counts as held. The first eight are teleop_twist_keyboard's."""

    speed: float = param(0.5, MIN_SPEED, FASTEST_LINEAR, "m/s", "linear speed at the start")
    turn: float = param(1.0, MIN_SPEED, FASTEST_ANGULAR, "rad/s", "turn rate at the start")
    speed_limit: float = param(FASTEST_LINEAR, MIN_SPEED, FASTEST_LINEAR, "m/s", "scaling goes no higher")
    turn_limit: float = param(FASTEST_ANGULAR, MIN_SPEED, FASTEST_ANGULAR, "rad/s", "scaling goes no higher")
    repeat_rate: float = param(
        20.0, 0, 200, "Hz", "a command is sent so often while a key is held; 0 sends at key events only"
    )
    key_timeout: float = param(
        0.6, 0.05, 5, "s", "a key counts as held so long after its first event; the keyboard's delay must be less"
    )
    stamped: bool = param(False, text="send TwistStamped instead of Twist", live=False)
    frame_id: str = param("", text="frame in the header of a TwistStamped", max_length=255, live=False)
    adaptive: bool = param(
        True, text="learn the keyboard's delay and interval; false waits key_timeout after every event"
    )
    give_way: float = param(
        3.0, 0.3, 60, "s", "simulation time for which zero is held after the last key; then others may drive"
    )
    keys: str = param(
        "", text="a script instead of a keyboard: 'i@0.5-2 k@2.5', KEY@FROM[-TO] in s", max_length=10_000, live=False
    )
    key_delay: float = param(0.5, 0.01, 5, "s", "delay of a scripted key's first repeat", live=False)
    key_interval: float = param(0.03, 0.005, 1, "s", "interval of a scripted key's repeats", live=False)


SERVICE = Service(
    name="teleop",
    about="drives a robot from the keyboard, or by a script of keys",
    run="services.teleop.loop:run",
    rate=50,
    parameters=TeleopParameters,
)
