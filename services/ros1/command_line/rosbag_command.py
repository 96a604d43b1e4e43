# ruff: noqa: D103
"""rosbag: show and play ROS 1 bags, with the arguments and output of ROS 1; for Elea's own bags see `elea bag`."""

import argparse
import sys
import time

import rosbag
import rospy

from services.ros1.command_line import run_command

SETTLE_S = 0.2


def info(args):
    parser = argparse.ArgumentParser(prog="rosbag info", description="Summarize the contents of bag files.")
    parser.add_argument("bags", nargs="+", metavar="BAGFILE")
    parser.add_argument("-y", "--yaml", action="store_true", help="print information as YAML")
    parser.add_argument("-k", "--key", help="print one value; for --yaml")
    parser.add_argument("--freq", action="store_true", help="display topic message frequency statistics")
    given = parser.parse_args(args)
    for number, name in enumerate(given.bags):
        if number:
            print("---")
        with rosbag.Bag(name) as bag:
            print(bag._get_yaml_info(given.key).rstrip() if given.yaml else overview(bag, given.freq))


def overview(bag, rates):
    types, topics = bag.get_type_and_topic_info()
    count, rows = bag.get_message_count(), []
    rows += [("path", bag.filename), ("version", f"{bag.version / 100:.1f}")]
    if count:
        start, end = bag.get_start_time(), bag.get_end_time()
        rows += [("duration", length(end - start)), ("start", moment(start)), ("end", moment(end))]
    rows += [("size", size(bag.size)), ("messages", str(count)), ("compression", "none")]
    wide = max(map(len, types), default=0)
    rows += several("types", [f"{name:{wide}} [{digest}]" for name, digest in sorted(types.items())])
    wide, digits = max(map(len, topics), default=0), len(str(count))
    rows += several(
        "topics",
        [
            f"{topic:{wide}}   {each.message_count:>{digits}} msgs"
            + (f" @ {each.frequency:.1f} Hz" if rates and each.frequency else "")
            + f"    : {each.msg_type}"
            + (f" ({each.connections} connections)" if each.connections > 1 else "")
            for topic, each in topics.items()
        ],
    )
    return "\n".join(f"{title + ':' if title else '':13}{text}" for title, text in rows)


def several(title, lines):
    return [(title if number == 0 else "", line) for number, line in enumerate(lines)]


def length(seconds):
    total = int(seconds)
    hours, minutes, rest = total // 3600, total // 60 % 60, total % 60
    if hours:
        return f"{hours}hr {minutes}:{rest:02d}s ({total}s)"
    return f"{minutes}:{rest:02d}s ({total}s)" if minutes else f"{seconds:.1f}s"


def moment(seconds):
    shown = time.strftime("%b %d %Y %H:%M:%S", time.localtime(seconds))
    return f"{shown}.{int(seconds % 1 * 100):02d} ({seconds:.2f})"


def size(count):
    if count < 1024:
        return f"{count} B"
    return f"{count / 1024:.1f} KB" if count < 1 << 20 else f"{count / (1 << 20):.1f} MB"


def play(args):
    parser = argparse.ArgumentParser(prog="rosbag play", description="Play back the contents of bag files.")
    parser.add_argument("bags", nargs="+", metavar="BAGFILE")
    parser.add_argument("-r", "--rate", type=float, default=1.0, help="multiply the publish rate by RATE")
    parser.add_argument("-s", "--start", type=float, default=0.0, help="start SEC seconds into the bag")
    parser.add_argument("-u", "--duration", type=float, help="play only SEC seconds")
    parser.add_argument("-d", "--delay", type=float, default=SETTLE_S, help="sleep SEC seconds before playing")
    parser.add_argument("-l", "--loop", action="store_true", help="loop playback")
    parser.add_argument("-i", "--immediate", action="store_true", help="play back without waiting")
    parser.add_argument("--topics", nargs="+", help="topics to play back")
    for ignored in (("-q", "--quiet"), ("-k", "--keep-alive"), ("--clock",), ("--pause",)):
        parser.add_argument(*ignored, action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--queue", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args(args)
    if not 0 < given.rate < float("inf"):
        sys.exit(f"rosbag play: --rate must be greater than 0, not {given.rate:g}")
    if given.clock:
        print("--clock is ignored: time is the fleet's simulation time, or wall time")
    bags = [rosbag.Bag(each) for each in given.bags]
    publishers = {}
    for bag in bags:
        print(f"opening {bag.filename}")
        advertise(bag, given.topics, publishers)
    print(f"Waiting {given.delay:g} seconds after advertising topics... ", end="", flush=True)
    time.sleep(given.delay)
    print("done.", flush=True)
    while play_once(bags, given, publishers) and given.loop:
        pass
    time.sleep(SETTLE_S)  # for messages on their way
    print("Done.")


def advertise(bag, topics, publishers):
    seen = set()
    for topic, message, _, header in bag.read_messages(topics, return_connection_header=True):
        if topic not in seen and topic != "/clock":
            seen.add(topic)
            if topic not in publishers:
                latch = str(header.get("latching", "0")) == "1"
                publishers[topic] = rospy.Publisher(topic, type(message), latch=latch, queue_size=100)


def play_once(bags, given, publishers):
    """Publish all messages in the order of their times; return False if the process is asked to end."""
    filled = [each for each in bags if each.get_message_count(given.topics)]
    if not filled:
        return False
    first = min(each.get_start_time() for each in filled) + given.start
    last = float("inf") if given.duration is None else first + given.duration
    began = time.monotonic()
    for topic, message, stamp in merged([each.read_messages(given.topics) for each in filled]):
        at = stamp.to_sec()
        if at < first or topic not in publishers:
            continue
        if at > last:
            break
        while not given.immediate and (left := began + (at - first) / given.rate - time.monotonic()) > 0:
            time.sleep(min(left, 0.1))
            if rospy.is_shutdown():
                return False
        if rospy.is_shutdown():
            return False
        publishers[topic].publish(message)
    return True


def merged(sources):
    import heapq

    return heapq.merge(*sources, key=lambda each: each.timestamp)


def main():
    command, *args = rospy.myargv()[1:] or [""]
    if command not in ("info", "play"):
        sys.exit("rosbag info BAGFILE, rosbag play BAGFILE")
    if command == "play":
        rospy.init_node("rosbag_play", anonymous=True)
    try:
        {"info": info, "play": play}[command](args)
    except BrokenPipeError:
        raise
    except (OSError, ValueError, rosbag.ROSBagException) as error:
        sys.exit(f"ERROR: {error}")
    except rospy.ROSInterruptException:
        pass


if __name__ == "__main__":
    run_command(main)
