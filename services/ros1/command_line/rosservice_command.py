# ruff: noqa: D103
"""rosservice: list, show and call services, with the arguments and output of ROS 1."""

import sys

import rospy
import rosservice
import yaml

from services.ros1.command_line import run_command
from services.script.waits import settle

COMMANDS = ("args", "call", "find", "info", "list", "type", "uri")


def list_services(args):
    names = [each for each in args if not each.startswith("-")]
    nodes = "-n" in args or "--nodes" in args
    found = rosservice.get_service_list(namespace=names[0] if names else None, include_nodes=nodes)
    print("\n".join(f"{each[0]} {','.join(each[1])}" if nodes else each for each in sorted(found)))


def call(args):
    args = [each for each in args if each not in ("-v", "--wait")]
    if not args:
        usage("rosservice call /service [args...]")
    name, *values = args
    if "--wait" in sys.argv:
        rospy.wait_for_service(name)
    arguments = [yaml.safe_load(each or "''") for each in values]  # an empty argument is an empty text
    if len(arguments) == 1 and isinstance(arguments[0], list):
        arguments = arguments[0]
    rospy.init_node("rosservice", anonymous=True)
    service = rosservice.get_service_class_by_name(name)
    if arguments == [""] and not service._request_class.__slots__:
        arguments = []
    _, response = rosservice.call_service(name, [each for each in arguments if each is not None], service)
    print(response)


def type_of(args):
    kind = rosservice.get_service_type(one(args, "rosservice type /service"))
    if kind is None:
        sys.exit(f"ERROR: Unknown service [{args[0]}]")
    print(kind)


def args_of(args):
    print(
        " ".join(rosservice.get_service_class_by_name(one(args, "rosservice args /service"))._request_class.__slots__)
    )


def info(args):
    name = one(args, "rosservice info /service")
    kind = rosservice.get_service_type(name)
    if kind is None:
        sys.exit(f"ERROR: Unknown service [{name}]")
    print(f"Node: {rosservice.get_service_node(name)}")
    print(f"Type: {kind}")
    print(f"Args: {' '.join(rosservice.get_service_class_by_name(name)._request_class.__slots__)}")


def find(args):
    print("\n".join(rosservice.rosservice_find(one(args, "rosservice find srv-type"))))


def one(args, text):
    if len(args) != 1:
        usage(text)
    return args[0]


def usage(text):
    sys.stderr.write(f"Usage: {text}\n")
    sys.exit(2)


def main():
    table = {
        "list": list_services,
        "call": call,
        "type": type_of,
        "args": args_of,
        "info": info,
        "find": find,
        "uri": lambda args: print(rosservice.get_service_uri(one(args, "rosservice uri /service"))),
    }
    args = rospy.myargv()[1:]
    if not args or args[0] not in table:
        sys.stderr.write("Commands:\n")
        sys.stderr.writelines(f"\trosservice {each}\n" for each in COMMANDS)
        sys.exit(0 if args and args[0] in ("-h", "--help") else 2)
    try:
        settle()
        table[args[0]](args[1:])
    except rosservice.ROSServiceException as error:
        sys.exit(f"ERROR: {error}")
    except yaml.YAMLError as error:
        sys.exit(f"ERROR: the arguments are not YAML: {' '.join(str(error).split())}")


if __name__ == "__main__":
    run_command(main)
