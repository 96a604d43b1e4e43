# ruff: noqa: D103
"""rosnode: list, show and ping nodes, with the arguments and output of ROS 1."""

import argparse
import sys
import time

import rosnode
import rospy

from services.ros1.command_line import run_command
from services.script.api import kernel
from services.script.waits import settle


def kill(args):
    known = rosnode.get_node_names()
    asked = [each if each.startswith("/") else f"/{each}" for each in args if not each.startswith("-")]
    if unknown := [each for each in asked if each not in known]:
        sys.stderr.write("ERROR: Unknown node(s):\n" + "".join(f" * {each}\n" for each in unknown))
    if {"-a", "--all"} & {*args}:
        end_all(known)
        return
    names = [each for each in asked if each in known] if asked else chosen(known)
    if not names:
        sys.exit(1 if asked else 0)
    print(f"killing {names[0]}" if len(names) == 1 else "killing:\n" + "\n".join(f" * {each}" for each in names))
    if failed := rosnode.kill_nodes(names)[1]:
        sys.stderr.write("ERROR: Failed to kill:\n" + "".join(f" * {each}\n" for each in failed))
        sys.exit(1)
    print("killed")
    if unknown:
        sys.exit(1)


def end_all(known):
    ended = [each for each in known if kernel().end_node(each, "user request")]
    print("killing:\n" + "\n".join(f" * {each}" for each in ended) if ended else "no ROS 1 program is running")
    print("the fleet's own nodes keep running; ./elea down stops the fleet")


def chosen(known):
    print("\n".join(f"{number}. {each}" for number, each in enumerate(known, 1)))
    print("\nPlease enter the number of the node you wish to kill.\n> ", end="", flush=True)
    number = sys.stdin.readline().strip()
    if not number.isdigit() or not 0 < int(number) <= len(known):
        sys.exit(f"invalid choice {number!r}")
    return [known[int(number) - 1]]


def ping(args):
    parser = argparse.ArgumentParser(prog="rosnode ping")
    parser.add_argument("node")
    parser.add_argument("-c", dest="count", type=int, default=4, help="number of pings to send")
    options = parser.parse_args(args)
    for _ in range(options.count):
        if not rosnode.rosnode_ping(options.node, verbose=True):
            sys.exit(1)
        time.sleep(1.0)


def main():
    command, *args = rospy.myargv()[1:] or [""]
    settle()
    if command == "list":
        names = [each for each in args if not each.startswith("-")]
        rosnode.rosnode_listnodes(names[0] if names else None)
    elif command == "info" and args:
        for each in args:
            name = each if each.startswith("/") else f"/{each}"
            if name not in rosnode.get_node_names():
                sys.exit(f"ERROR: Unknown node {name}")
            print("-" * 80)
            rosnode.rosnode_info(name)
    elif command == "ping":
        ping(args)
    elif command == "kill":
        kill(args)
    elif command == "cleanup":
        print("nodes that have ended are removed immediately: there is nothing to clean up")
    elif command == "machine":
        print("localhost")
    else:
        sys.stderr.write("Commands:\n")
        sys.stderr.writelines(f"\trosnode {each}\n" for each in ("ping", "list", "info", "kill", "cleanup"))
        sys.exit(0 if command in ("-h", "--help") else 2)


if __name__ == "__main__":
    run_command(main)
