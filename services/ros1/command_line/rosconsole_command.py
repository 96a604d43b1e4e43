# ruff: noqa: D103
"""rosconsole: show and set the levels of a node's loggers, and show log messages, with the arguments of ROS 1."""

import sys

import rospy
from roscpp.srv import GetLoggers, SetLoggerLevel
from rosgraph_msgs.msg import Log

from services.ros1.command_line import run_command
from services.script.waits import settle

LEVELS = {"debug": Log.DEBUG, "info": Log.INFO, "warn": Log.WARN, "error": Log.ERROR, "fatal": Log.FATAL}
USAGE = {
    "list": "rosconsole list NODE",
    "get": "rosconsole get NODE LOGGER",
    "set": "rosconsole set NODE LOGGER debug|info|warn|error|fatal",
    "echo": "rosconsole echo [-l LEVEL] [NODE]",
}


def loggers_of(node):
    return {each.name: each.level for each in proxy(node, "get_loggers", GetLoggers)().loggers}


def proxy(node, name, kind):
    node = f"/{node.strip('/')}"
    if f"{node}/{name}" not in [each.name for each in running().graph() if each.kind == "srv"]:
        known = node in running().nodes()
        sys.exit(f"ERROR: {node} has no loggers: it is not a ROS 1 program" if known else f"ERROR: Unknown node {node}")
    return rospy.ServiceProxy(f"{node}/{name}", kind)


def running():
    from services.script.api import kernel

    return kernel()


def list_loggers(node):
    print("\n".join(loggers_of(node)))


def get(node, logger):
    levels = loggers_of(node)
    if logger not in levels:
        sys.exit(f"ERROR: {node} has no logger {logger}: there are {', '.join(levels)}")
    print(levels[logger])


def set_level(node, logger, level):
    proxy(node, "set_logger_level", SetLoggerLevel)(logger, level)


def echo(*words):
    words, least = list(words), Log.DEBUG
    if words[:1] in (["-l"], ["--level"]):
        if len(words) < 2 or words[1].lower() not in LEVELS:
            usage("echo")
        least, words = LEVELS[words[1].lower()], words[2:]
    nodes = {f"/{each.strip('/')}" for each in words}
    names = {level: name.upper() for name, level in LEVELS.items()}

    def show(line):
        if line.level >= least and (not nodes or line.name in nodes):
            print(f"[{names.get(line.level, line.level):>5}] [{line.name}]: {line.msg}", flush=True)

    rospy.Subscriber("/rosout", Log, show)
    rospy.spin()


def usage(command=None):
    lines = [USAGE[command]] if command else USAGE.values()
    sys.stderr.write("".join(["Usage:\n", *(f"\t{each}\n" for each in lines)]))
    sys.exit(2)


def main():
    command, *args = rospy.myargv()[1:] or [""]
    if command in ("-h", "--help"):
        print("\n".join(USAGE.values()))
        return
    table = {"list": (list_loggers, 1), "get": (get, 2), "set": (set_level, 3), "echo": (echo, None)}
    if command not in table:
        usage()
    run, count = table[command]
    if count is not None and len(args) != count:
        usage(command)
    settle()
    rospy.init_node("rosconsole", anonymous=True)
    try:
        run(*args)
    except rospy.ServiceException as error:
        sys.exit(f"ERROR: {error}")


if __name__ == "__main__":
    run_command(main)
