# ruff: noqa: D103, B905
"""rostopic: list, show, publish and measure topics, with the arguments and output of ROS 1."""

import argparse
import sys
import time
from collections import deque

import genpy
import rosgraph
import rospy
import rostopic
import yaml

from services.ros1.command_line import run_command
from services.script.waits import settle

COMMANDS = ("bw", "delay", "echo", "find", "hz", "info", "list", "pub", "type")


def list_topics(args):
    parser = argparse.ArgumentParser(prog="rostopic list")
    parser.add_argument("namespace", nargs="?", default="")
    parser.add_argument("-v", "--verbose", action="store_true")
    parser.add_argument("-p", dest="publishers", action="store_true", help="list only publishers")
    parser.add_argument("-s", dest="subscribers", action="store_true", help="list only subscribers")
    options = parser.parse_args(args)
    published, subscribed = (
        [each for each in part if inside(each[0], options.namespace)] for part in rostopic.get_topic_list()
    )
    if options.verbose:
        for title, noun, part in (("Published", "publisher", published), ("Subscribed", "subscriber", subscribed)):
            print(f"\n{title} topics:")
            for name, kind, nodes in part:
                print(f" * {name} [{kind}] {len(nodes)} {noun}{'s' if len(nodes) > 1 else ''}")
        print()
        return
    parts = [published] if options.publishers else [subscribed] if options.subscribers else [published, subscribed]
    print("\n".join(sorted({name for part in parts for name, _, _ in part})))


def inside(name, namespace):
    prefix = "/" + namespace.strip("/")
    return not namespace.strip("/") or name == prefix or name.startswith(f"{prefix}/")


def echo(args):
    parser = argparse.ArgumentParser(prog="rostopic echo")
    parser.add_argument("topic")
    parser.add_argument("-n", type=int, default=0, help="number of messages to echo")
    parser.add_argument("-c", "--clear", action="store_true", help="clear the screen before each message")
    parser.add_argument("-p", dest="plot", action="store_true", help="one line for each message, as CSV")
    parser.add_argument("--noarr", action="store_true", help="without arrays")
    parser.add_argument("--nostr", action="store_true", help="without strings")
    parser.add_argument("--filter", default="", help="Python expression of the message m")
    parser.add_argument("--offset", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(args)
    rospy.init_node("rostopic", anonymous=True)
    data_class, topic, select = rostopic.get_topic_class(options.topic)
    if data_class is None:
        sys.stderr.write(f"WARNING: topic [{options.topic}] does not appear to be published yet\n")
        data_class, topic, select = rostopic.get_topic_class(options.topic, blocking=True)
    if data_class is None:
        return
    left = [options.n or -1]
    matches = eval(f"lambda m: {options.filter}") if options.filter else lambda m: True

    begun = False

    def show(message):
        nonlocal begun
        if left[0] == 0 or not matches(message):
            return
        value = select(message) if select else message
        if value is None and select:
            return
        left[0] -= 1
        if options.plot:
            if not begun:
                begun = True
                print(",".join(["%time", *(f"field.{name}" for name, _ in leaves(value))]).replace("field.,", "field,"))
            print(",".join([str(rospy.Time.now().to_nsec()), *(str(each) for _, each in leaves(value))]), flush=True)
            return
        if options.clear:
            sys.stdout.write("\033[2J\033[;H")
        print(text(value, options.noarr, options.nostr))
        print("---", flush=True)

    rospy.Subscriber(topic, data_class, show)
    while not rospy.is_shutdown() and left[0] != 0:
        time.sleep(0.02)


def text(value, noarr=False, nostr=False):
    if not isinstance(value, genpy.Message):
        return genpy.message.strify_message(value)

    def kept(message):
        for name, kind in zip(message.__slots__, message._slot_types):
            if not (noarr and "[" in kind) and not (nostr and "string" in kind):
                yield name

    return genpy.message.strify_message(value, field_filter=kept if noarr or nostr else None)


def leaves(value, name=""):
    """Yield the scalar values of a message by dotted name."""
    if isinstance(value, genpy.Message):
        for each in value.__slots__:
            yield from leaves(getattr(value, each), f"{name}.{each}".lstrip("."))
    elif isinstance(value, (list, tuple)):
        for index, each in enumerate(value):
            yield from leaves(each, f"{name}{index}")
    elif isinstance(value, genpy.TVal):
        yield name, value.to_nsec()
    else:
        yield name, value


def pub(args):
    parser = argparse.ArgumentParser(prog="rostopic pub")
    parser.add_argument("-r", "--rate", type=float, help="publish repeatedly at this rate (hz)")
    parser.add_argument("-1", "--once", action="store_true", help="publish one message and exit")
    parser.add_argument("-l", "--latch", action="store_true", help="latch (with -r)")
    parser.add_argument("-f", "--file", help="read the arguments from a YAML file")
    parser.add_argument("-s", "--substitute", action="store_true", help="replace auto and now in the arguments")
    parser.add_argument("-v", dest="verbose", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--use-rostime", action="store_true", help=argparse.SUPPRESS)
    own, rest = split(args, {"-r", "--rate", "-f", "--file"})
    options = parser.parse_args(own)
    if not rest:
        parser.error("/topic must be specified")
    topic, *rest = rest
    kind, *values = rest if rest else [rostopic.get_topic_type(topic)[0]]
    if kind is None:
        parser.error("topic type must be specified")
    arguments = [yaml.safe_load(each) for each in values]
    if options.file:
        with open(options.file, encoding="utf-8") as file:
            arguments = [each for each in yaml.safe_load_all(file) if each is not None]
    if len(arguments) == 1 and isinstance(arguments[0], list):
        arguments = arguments[0]
    data_class = genpy.message.get_message_class(kind)
    if data_class is None:
        sys.exit(f"ERROR: invalid message type: {kind}.\nrosmsg list shows the known types")
    rospy.init_node("rostopic", anonymous=True)
    message = data_class()
    now = rospy.get_rostime()
    keys = {"now": now}
    if "std_msgs/Header" in getattr(data_class, "_slot_types", ()):
        from std_msgs.msg import Header

        keys["auto"] = Header(stamp=now)
    try:
        genpy.message.fill_message_args(message, arguments, keys=keys)
    except genpy.MessageException as error:
        sys.exit(f"ERROR: {error}")
    repeated = options.rate is not None
    publisher = rospy.Publisher(topic, data_class, latch=not repeated or options.latch, queue_size=100)
    wait_until_seen(publisher)
    if repeated:
        rate = rospy.Rate(options.rate)
        while not rospy.is_shutdown():
            publisher.publish(message)
            rate.sleep()
        return
    publisher.publish(message)
    if options.once:
        print("publishing and latching message for 3.0 seconds", flush=True)
        deadline = time.time() + 3.0
        while time.time() < deadline and not rospy.is_shutdown():
            time.sleep(0.05)
        return
    print("publishing and latching message. Press ctrl-C to terminate", flush=True)
    rospy.spin()


def wait_until_seen(publisher, seconds=0.3):
    deadline = time.time() + seconds
    while publisher.get_num_connections() == 0 and time.time() < deadline and not rospy.is_shutdown():
        time.sleep(0.02)


def split(args, with_value):
    """Separate options from arguments; - followed by a digit is an argument, except for -1."""
    own, words, rest = [], [], list(args)
    while rest:
        each = rest.pop(0)
        if each == "--":
            return own, words + rest
        if (each.startswith("-") and (each == "-1" or not each[1:2].isdigit()) and len(words) < 2) or each in (
            "-r",
            "--rate",
            "-1",
            "--once",
            "-l",
            "--latch",
            "-s",
        ):
            own.append(each)
            if each in with_value and rest:
                own.append(rest.pop(0))
        else:
            words.append(each)
    return own, words


def hz(args):
    parser = argparse.ArgumentParser(prog="rostopic hz")
    parser.add_argument("topics", nargs="+")
    parser.add_argument("-w", "--window", type=int, default=-1)
    parser.add_argument("--wall-time", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(args)
    rospy.init_node("rostopic", anonymous=True)
    meter = rostopic.ROSTopicHz(options.window, use_wtime=True)
    for each in options.topics:
        name = rosgraph.names.script_resolve_name("rostopic", each)
        rospy.Subscriber(name, rospy.AnyMsg, meter.callback_hz, callback_args=name)
        print(f"subscribed to [{name}]", flush=True)
    names = [rosgraph.names.script_resolve_name("rostopic", each) for each in options.topics]
    while not rospy.is_shutdown():
        time.sleep(1.0)
        if not rospy.is_shutdown():
            meter.print_hz(names)
            sys.stdout.flush()


def bw(args):
    parser = argparse.ArgumentParser(prog="rostopic bw")
    parser.add_argument("topic")
    options = parser.parse_args(args)
    rospy.init_node("rostopic", anonymous=True)
    sizes, last = deque(maxlen=100), None
    name = rosgraph.names.script_resolve_name("rostopic", options.topic)
    rospy.Subscriber(name, rospy.AnyMsg, lambda message: sizes.append((time.time(), len(message._buff))))
    print(f"subscribed to [{name}]", flush=True)
    while not rospy.is_shutdown():
        time.sleep(1.0)
        recent = list(sizes)
        if len(recent) < 2 or recent[-1] == last:
            print("no new messages", flush=True)
            continue
        last = recent[-1]
        lengths = [size for _, size in recent]
        seconds = recent[-1][0] - recent[0][0]
        print(f"average: {sum(lengths[1:]) / max(seconds, 1e-9):.2f}B/s")
        mean, least, most = sum(lengths) / len(lengths), min(lengths), max(lengths)
        print(f"\tmean: {mean:.2f}B min: {least:.2f}B max: {most:.2f}B window: {len(lengths)}", flush=True)


def delay(args):
    sys.exit("rostopic delay is not provided: use ./elea topic delay")


def info(args):
    print(f"\n{rostopic.get_info_text(one(args, 'rostopic info /topic'))}\n".replace("\n\n\n", "\n\n"))


def type_of(args):
    topic = one(args, "rostopic type /topic")
    kind, _, _ = rostopic.get_topic_type(topic)
    if kind is None:
        sys.exit(1)
    print(kind)


def find(args):
    print("\n".join(rostopic.find_by_type(one(args, "rostopic find msg-type"))))


def one(args, usage):
    if len(args) != 1:
        sys.stderr.write(f"Usage: {usage}\n")
        sys.exit(2)
    return args[0]


def main():
    table = {
        "list": list_topics,
        "echo": echo,
        "pub": pub,
        "hz": hz,
        "bw": bw,
        "delay": delay,
        "info": info,
        "type": type_of,
        "find": find,
    }
    args = rospy.myargv()[1:]
    if not args or args[0] not in table:
        sys.stderr.write("Show, measure and publish topics, as rostopic of ROS 1.\n\nCommands:\n")
        sys.stderr.writelines(f"\trostopic {each}\n" for each in COMMANDS)
        sys.exit(0 if args and args[0] in ("-h", "--help") else 2)
    try:
        settle()
        table[args[0]](args[1:])
    except rostopic.ROSTopicException as error:
        sys.exit(f"ERROR: {error}")
    except yaml.YAMLError as error:
        sys.exit(f"ERROR: the arguments are not YAML: {' '.join(str(error).split())}")


if __name__ == "__main__":
    run_command(main)
