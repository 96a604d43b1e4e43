# ruff: noqa: D103
"""rosmsg and rossrv: show the definitions of messages and services, with the arguments and output of ROS 1."""

import sys

import rosmsg
import rospkg
import rospy

from services.ros1.command_line import run_command

COMMANDS = ("show", "info", "list", "md5", "package", "packages")


def main():
    mode = sys.argv[1]
    command, *args = rospy.myargv()[2:] or [""]
    raw = "-r" in args or "--raw" in args
    args = [each for each in args if not each.startswith("-")]
    kind = rosmsg.MODE_MSG if mode == "rosmsg" else rosmsg.MODE_SRV
    text = rosmsg.get_msg_text if mode == "rosmsg" else rosmsg.get_srv_text
    try:
        if command in ("show", "info") and args:
            for each in args:
                for name in [each] if "/" in each else by_base_name(each, kind):
                    found = text(name, raw=raw).rstrip("\n")
                    print(found if "/" in each else f"[{name}]:\n{found}")
        elif command == "md5" and args:
            print(rosmsg.rosmsg_md5(kind, args[0]))
        elif command == "list":
            print("\n".join(every(kind)))
        elif command == "package" and args:
            print("\n".join(rosmsg.list_types(args[0], kind)))
        elif command == "packages":
            print(" ".join(sorted({each.partition("/")[0] for each in every(kind)})))
        else:
            sys.stderr.write("Commands:\n")
            sys.stderr.writelines(f"\t{mode} {each}\n" for each in COMMANDS)
            sys.exit(0 if command in ("-h", "--help") else 2)
    except (rosmsg.ROSMsgException, rospkg.ResourceNotFound) as error:
        sys.exit(f"ERROR: {error}")


def every(kind):
    from messages.interfaces import catalogue

    known = catalogue()
    return sorted({each for package in known.packages() for each in rosmsg.list_types(package, kind)})


def by_base_name(name, kind):
    found = [each for each in every(kind) if each.partition("/")[2] == name]
    if not found:
        raise rosmsg.ROSMsgException(f"Could not find msg '{name}'")
    return found


if __name__ == "__main__":
    run_command(main)
