"""A program that imports nothing of Elea: drives tb3_0 ahead at 20 Hz, speeds up with its last command, goes silent.

Zenoh's configuration is the file named by the environment variable ZENOH_CONFIG.
"""

import msgpack
import zenoh

START = 0.0
"""y of the robot at the start [m]; it faces along y."""


def drive(session: zenoh.Session) -> None:
    """Command every 0.05 s of odometry time until the robot is 0.15 m ahead; then wait until it stands still."""
    odometry = session.declare_subscriber("tb3_0/odom")
    commands = session.declare_publisher("tb3_0/cmd_vel")
    due, sent, last = 0.0, 0, False
    while True:
        odom = msgpack.unpackb(odometry.recv().payload.to_bytes())
        stamp = odom["header"]["stamp"]
        now = stamp["sec"] + stamp["nanosec"] / 1e9
        if last:
            if odom["twist"]["twist"]["linear"]["x"] < 1e-3:
                print(sent, now)
                return
        elif now >= due:
            due, sent = now + 0.05, sent + 1
            last = odom["pose"]["pose"]["position"]["y"] > START + 0.15
            commands.put(msgpack.packb({"linear": {"x": 0.2 if last else 0.1}}))


with zenoh.open(zenoh.Config.from_env()) as network:
    drive(network)
