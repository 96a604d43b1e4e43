# ruff: noqa: D103
"""rosparam: list, get and set parameters, with the arguments and output of ROS 1."""

import sys

import rosparam
import rospy
import yaml

from services.ros1.command_line import run_command

COMMANDS = ("set", "get", "load", "dump", "delete", "list")


def main():
    command, *args = rospy.myargv()[1:] or [""]
    pretty = "-p" in args
    args = [each for each in args if each not in ("-v", "-p")]
    try:
        if command == "list" and len(args) <= 1:
            print("\n".join(rosparam.list_params(args[0] if args else "/")))
        elif command == "get" and len(args) == 1:
            show(rosparam.get_param(args[0]), pretty)
        elif command == "set" and len(args) == 2:
            set_value(*args)
        elif command == "set" and args[:1] in (["-t"], ["--textfile"]) and len(args) == 3:
            with open(args[1], encoding="utf-8") as file:
                rosparam.set_param_raw(args[2], file.read())
        elif command == "load" and args:
            load(*args[:2])
        elif command == "dump" and len(args) <= 2:
            value = rosparam.get_param(args[1] if len(args) > 1 else "/")
            if args:
                with open(args[0], "w", encoding="utf-8") as file:
                    yaml.safe_dump(value, file)
            else:
                print(yaml.safe_dump(value), end="")
        elif command == "delete" and len(args) == 1:
            rosparam.delete_param(args[0])
        else:
            sys.stderr.write("Commands:\n")
            sys.stderr.writelines(f"\trosparam {each}\n" for each in COMMANDS)
            sys.exit(0 if command in ("-h", "--help") else 2)
    except rosparam.RosParamException as error:
        sys.exit(f"ERROR: {error}")
    except BrokenPipeError:
        raise
    except OSError as error:
        sys.exit(f"ERROR: {error.filename}: {error.strerror}")
    except yaml.YAMLError as error:
        sys.exit(f"ERROR: this is not YAML: {' '.join(str(error).split())}")


def set_value(name, text):
    value = yaml.safe_load(text)
    if isinstance(value, dict):
        rosparam.upload_params(name, value)
    else:
        rosparam.set_param_raw(name, "" if value is None else value)


def load(file, namespace=None):
    if file == "-":
        found = rosparam.load_str(sys.stdin.read(), "stdin", namespace)
    else:
        found = rosparam.load_file(file, namespace)
    for values, space in found:
        rosparam.upload_params(space, values)


def show(value, pretty):
    if isinstance(value, str):
        print(value if pretty else yaml.safe_dump(value, width=10**9).removesuffix("\n...\n").rstrip("\n"))
    elif isinstance(value, bool | int | float):
        print(yaml.safe_dump(value).removesuffix("\n...\n").rstrip("\n"))
    elif isinstance(value, list):
        print(yaml.safe_dump(value, default_flow_style=True, width=10**9).rstrip("\n"))
    else:
        print(yaml.safe_dump(value), end="")


if __name__ == "__main__":
    run_command(main)
