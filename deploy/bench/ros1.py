"""ROS 1 programs: start, memory, round trip, decoding, lockstep, and a loop that never waits."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import psutil

from deploy.bench.barrier import killed_at_exit
from deploy.bench.figures import Figure, ratios
from deploy.bench.fleet import BenchFleet, watch_fleet
from deploy.bench.peer import DRIVE, DRIVEN, bench_node, make_odometry
from messages.geometry import Twist
from messages.nav import Odometry
from messages.topics import Quality, Topic
from services.runtime.node import Node
from services.runtime.transport.unix_sockets import router_in

TRIPS = 400
"""Number of round trips per block."""
TRIP_TIMEOUT_S = 30.0
LAP_S, LAP_ROBOTS = 20.0, 4
"""Simulation time of a run in lockstep, and its number of robots."""
BESIDE, BESIDE_FROM_S = "bare", 2.0
"""The fleet beside which programs run, and from when on [s]: by then it has started."""
BUSY_FROM_S, BUSY_S = 2.0, 4.0
"""Wall time before the busy loop is measured, and duration of the measurement."""

LISTENER = """
import rospy
from nav_msgs.msg import Odometry

def heard(msg):
    print("heard", flush=True)
    sub.unregister()

rospy.init_node("listener")
sub = rospy.Subscriber("/tb3_0/odom", Odometry, heard)
rospy.spin()
"""
DRIVER = """
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

def drive(msg):
    command = Twist()
    command.linear.x = msg.pose.pose.position.x
    pub.publish(command)

rospy.init_node("driver")
pub = rospy.Publisher("cmd_vel", Twist, queue_size=1)
rospy.Subscriber("odom", Odometry, drive)
rospy.spin()
"""
DECODE = """
import timeit
import genpy
from nav_msgs.msg import Odometry

msg = Odometry()
msg.header.frame_id = "tb3_0/odom"
msg.pose.pose.position.x = 1.2345
msg.pose.covariance = [1e-5 * i for i in range(36)]
payload = genpy.encode(msg)
print(min(timeit.repeat(lambda: genpy.decode(Odometry, payload), number=2000, repeat=7)) / 2000 * 1e6)
"""
WAYPOINTS = """
import math
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from tf.transformations import euler_from_quaternion

class Driver:
    def __init__(self):
        rospy.init_node("waypoints")
        self.pose, self.yaw = None, 0.0
        self.pub = rospy.Publisher("cmd_vel", Twist, queue_size=1)
        rospy.Subscriber("odom", Odometry, self.odometry)

    def odometry(self, msg):
        self.pose = msg.pose.pose.position
        q = msg.pose.pose.orientation
        self.yaw = euler_from_quaternion([q.x, q.y, q.z, q.w])[2]

    def run(self):
        rate, goal = rospy.Rate(25), 0
        goals = [(1.0, 0.0), (1.0, 0.3), (0.0, 0.3), (0.0, 0.0)]
        while not rospy.is_shutdown():
            command = Twist()
            if self.pose is not None:
                dx, dy = goals[goal][0] - self.pose.x, goals[goal][1] - self.pose.y
                turn = math.remainder(math.atan2(dy, dx) - self.yaw, 2 * math.pi)
                command.linear.x, command.angular.z = 0.2 * max(0.0, math.cos(turn)), 1.5 * turn
                if math.hypot(dx, dy) < 0.1:
                    goal = (goal + 1) % 4
            self.pub.publish(command)
            rate.sleep()

try:
    Driver().run()
except rospy.ROSInterruptException:
    pass
"""
BUSY = """
import rospy

rospy.init_node("busy")
seen = 0
while not rospy.is_shutdown():
    seen += 1
"""
OURS = 'kind = "waypoint"\nparameters = { goals = [[1, 0], [1, 0.3], [0, 0.3], [0, 0]], laps = 0 }\n'
THEIRS = 'kind = "waypoints.py"\n'


def measure_ros1(rounds: int, port: int, say: Callable[[str], None]) -> list[Figure]:
    """Measure every figure of programs written for ROS 1."""
    figures: list[Figure] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, text in (("listener", LISTENER), ("driver", DRIVER), ("decode", DECODE), ("busy", BUSY)):
            (folder / f"{file}.py").write_text(text)
        say("ROS 1: start, memory, a busy loop")
        figures += _beside_a_fleet(rounds, folder, port)
        say("ROS 1: round trips")
        figures += _round_trips(rounds, folder)
        say("ROS 1: lockstep")
        figures += _lockstep(rounds, folder, port)
    return figures


@contextmanager
def _script(file: Path, *options: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-P", "-m", "services.script", *options, str(file)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        yield process
    finally:
        process.terminate()
        process.communicate()


def _beside_a_fleet(rounds: int, folder: Path, port: int) -> list[Figure]:
    """Measure start and memory of a listener, and the processor time of a busy loop, beside a fleet."""
    starts, memory, busy = [], [], []
    with (
        BenchFleet(BESIDE, folder / "beside", port, "--mode", "real") as fleet,
        watch_fleet(fleet) as watch,
    ):
        watch.wait_until(BESIDE_FROM_S)
        for number in range(rounds):
            connect = ("--connect", fleet.endpoint)
            begun = time.perf_counter()
            with _script(folder / "listener.py", *connect, "--name", f"listener{number}") as process:
                assert process.stdout is not None
                if process.stdout.readline() != "heard\n":
                    raise RuntimeError("a listener ended before it heard any odometry")
                starts.append(time.perf_counter() - begun)
                memory.append(psutil.Process(process.pid).memory_info().rss / 2**20)
            with _script(folder / "busy.py", *connect, "--name", f"busy{number}") as process:
                watch.wait_until(watch.now + BUSY_FROM_S)
                seen = psutil.Process(process.pid)
                before, began = sum(seen.cpu_times()[:2]), time.perf_counter()
                watch.wait_until(watch.now + BUSY_S)
                busy.append(100 * (sum(seen.cpu_times()[:2]) - before) / (time.perf_counter() - began))
    decoded = subprocess.run(
        [sys.executable, "-P", "-m", "services.script", str(folder / "decode.py")],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    return [
        Figure("ros1_start_s", "s", "from the start of a rospy program to its first callback", tuple(starts), 1.5),
        Figure("ros1_memory_mib", "MiB", "resident, that program", tuple(memory), 60.0),
        Figure("ros1_busy_cpu_percent", "%", "of a core, a rospy loop that never waits", tuple(busy), 40.0),
        Figure("ros1_decode_us", "us", "decoding an Odometry into a ROS 1 message", (float(decoded.stdout),), 25.0),
    ]


def _round_trips(rounds: int, folder: Path) -> list[Figure]:
    """Measure an odometry to a program and its command back: a service of ours and a rospy program in turn."""
    endpoint = router_in(folder)
    module = [sys.executable, "-P", "-m"]
    script = [*module, "services.script", "--connect", endpoint, "--wall-time", "--namespace", "/script"]
    commands = (
        [*module, "services", "router", "--param", f"listen={endpoint}"],
        [*module, "deploy.bench.peer", "drive", "--connect", endpoint],
        [*script, str(folder / "driver.py")],
    )
    times: dict[str, list[float]] = {"ours": [], "theirs": []}
    with ExitStack() as stack:
        log = stack.enter_context((folder / "partners.log").open("wb"))
        for command in commands:
            stack.enter_context(killed_at_exit(subprocess.Popen(command, stdout=log, stderr=log)))
        node = stack.enter_context(bench_node(endpoint))
        trips = {
            "ours": _Trip(node, DRIVE, DRIVEN),
            "theirs": _Trip(
                node,
                Topic("/script/odom", Odometry, 0, Quality.SENSOR, "measured round trip, out"),
                Topic("/script/cmd_vel", Twist, 0, Quality.SENSOR, "measured round trip, back"),
            ),
        }
        for each in trips.values():
            each.wait_for_peer()
        for number in range(rounds):
            for name in sorted(trips, reverse=bool(number % 2)):
                times[name].append(statistics.median(trips[name].measure() for _ in range(TRIPS)))
    micro = tuple(each * 1e6 for each in times["theirs"])
    about = "odometry to a rospy callback and its cmd_vel back / to a service of ours, median"
    return [
        Figure("ros1_trip_ratio", "", about, ratios(times["theirs"], times["ours"]), at_most=1.5),
        Figure("ros1_trip_us", "us", "the same, absolute", micro),
    ]


class _Trip:
    """A round trip: odometry out and a command back."""

    def __init__(self, node: Node, out: Topic[Odometry], back: Topic[Twist]) -> None:
        self._node = node
        self._out = node.advertise(out, out.name)
        self._back = node.subscribe(back, back.name)
        self._odometry = make_odometry()

    def wait_for_peer(self) -> None:
        """Publish until the other side answers."""
        deadline = time.monotonic() + TRIP_TIMEOUT_S
        while not self._answered():
            if time.monotonic() > deadline:
                raise TimeoutError(f"no answer within {TRIP_TIMEOUT_S:g} s")
            self._out.publish(self._odometry)
            time.sleep(0.05)
        time.sleep(0.2)
        self._answered()

    def measure(self) -> float:
        """Return the time of one round trip [s]."""
        begun = time.perf_counter()
        self._out.publish(self._odometry)
        while not self._answered():
            if time.perf_counter() - begun > TRIP_TIMEOUT_S:
                raise TimeoutError("an answer was lost")
            self._node.transport.wait(self._back.raw)
        return time.perf_counter() - begun

    def _answered(self) -> bool:
        self._node.update_subscribers()
        return bool(self._back.messages)


def _lockstep(rounds: int, folder: Path, port: int) -> list[Figure]:
    """Measure the speed of four rospy programs in lockstep, and of our own controllers on the same robots."""
    (folder / "waypoints.py").write_text(WAYPOINTS)
    factors: dict[str, list[float]] = {"ours": [], "theirs": []}
    for name, text in (("ours", OURS), ("theirs", THEIRS)):
        (folder / f"{name}.toml").write_text(_lap_fleet(text))
    for number in range(rounds):
        for name in sorted(factors, reverse=bool(number % 2)):
            results = folder / f"{name}{number}"
            with BenchFleet(str(folder / f"{name}.toml"), results, port) as fleet:
                report = fleet.finish()
            if report["run"]["members_lost"] or report["run"]["absent"]:
                raise RuntimeError(f"lockstep went on without some program: {json.dumps(report['run'])}")
            factors[name].append(report["run"]["real_time_factor"])
    return [
        Figure(
            "ros1_lockstep_ratio",
            "",
            "speed of four robots in lockstep driven by rospy programs / by waypoint",
            ratios(factors["theirs"], factors["ours"]),
            at_least=0.6,
        ),
        Figure("ros1_lockstep_factor", "x", "the same, simulated per wall-clock second", tuple(factors["theirs"])),
    ]


def _lap_fleet(controller: str) -> str:
    """Return the file of a fleet whose robots drive laps in lockstep, each by a controller."""
    robots = "".join(
        f'[[robot]]\nname = "tb3_{number}"\nmodel = "burger"\npose = {{ y = {2.0 * number} }}\n'
        for number in range(LAP_ROBOTS)
    )
    return f"""
name = "lap"
[run]
mode = "lockstep"
ends = "duration"
duration = {LAP_S:g}
{robots}[[every_robot]]
{controller}"""
