"""Processes of scripts without a fleet: exit status and output."""

from __future__ import annotations

import signal
import time
from contextlib import ExitStack
from pathlib import Path

from tests.harness.cases import case
from tests.harness.processes import Process
from tests.harness.waiting import wait_until

HEAD = "from services.script.api import kernel\nk = kernel()\nk.start('/probe_{name}', '/', 'script')\n"
HOOK = "k.on_shutdown(lambda: print('hook', k.shutting_down))\nprint('up')\n"

ENDS = {
    "returns": ("print('done')\n", 0, ["done"]),
    "hook": (HEAD + HOOK + "print('end')\n", 0, ["end", "hook False"]),
    "raises": (HEAD + HOOK + "def f():\n    return 1 / 0\nf()\n", 1, ['raises.py", line 7, in f', "division", "hook"]),
    "exits": ("import sys\nsys.exit(3)\n", 3, []),
    "says": ("raise SystemExit('bad thing')\n", 1, ["bad thing"]),
    "leaves": (HEAD + "import os\nos._exit(7)\n", 7, []),
    "syntax": ("x = 1\ndef f(:\n    pass\n", 1, ['syntax.py", line 2', "def f(:", "SyntaxError"]),
    "python2": (
        "print 'a', 7/2\nraise ValueError, 'b'\n",
        1,
        ["converted", "a 3", 'python2.py", line 2', "ValueError: b"],
    ),
    "missing": ("\nimport moveit_commander\n", 1, ["`moveit_commander` is not part of Elea (import in missing.py:2)"]),
    "prints": ("for i in range(20000):\n    print('x' * 200)\nprint('end')\n", 0, ["end"]),
    "threads": (
        "import threading, time\nended = threading.Event()\n"
        "threading.Thread(target=lambda: (ended.wait(), time.sleep(0.3), print('thread ended'))).start()\n"
        "print('main ended')\nended.set()\n",
        0,
        ["main ended", "thread ended"],
    ),
}
"""By name: the script, its exit status, and its output in order."""

INTERRUPTED = {
    "waits": HOOK + "k.wait_until(lambda: False)\nprint('after')\n",
    "loops": HOOK + "while True:\n    k.sleep_until(k.now() + 50_000_000)\n",
    "computes": HOOK + "i = 0\nwhile True:\n    i += 1\n",
    "blocks": HOOK + "import socket\ns = socket.socket(type=socket.SOCK_DGRAM)\ns.bind(('127.0.0.1', 0))\ns.recv(9)\n",
    "swallows": HOOK + "import time\nwhile True:\n    try:\n        time.sleep(10)\n    except:\n        pass\n",
    "follows": HOOK + "while not k.shutting_down:\n    k.point()\nprint('after')\n",
    "calls": HOOK
    + "import rospy\nfrom std_srvs.srv import Empty\nrospy.on_shutdown(lambda: None)\n"
    + "while not rospy.is_shutdown():\n    k.point()\nprint('after')\nrospy.ServiceProxy('/nobody', Empty)()\n",
    "callback": HOOK
    + "k.subscribe('/own', 'std_msgs/Empty', lambda *_: [None for _ in iter(int, 1)])\n"
    + "k.advertise('/own', 'std_msgs/Empty').publish(b'\\x80')\nk.wait_until(lambda: False)\nprint('after')\n",
}
"""Scripts that end within about a second on SIGINT, after their hooks."""
SECONDS = 6.0
"""Wall time for all of them to end on a busy machine."""


def start(stack: ExitStack, folder: Path, name: str, source: str) -> Process:
    """Run a script on wall time, without a network."""
    file = folder / f"{name}.py"
    file.write_text(source.replace("{name}", name))
    router = f"unixsock-stream/{folder}/router.sock"
    arguments = ["-m", "services.script", "--wall-time", "--connect", router, str(file)]
    return stack.enter_context(Process(arguments, folder / f"{name}.log"))


def test_scripts_end_with_their_own_status_and_say_why(tmp_path: Path) -> None:
    with ExitStack() as stack:
        running = {name: start(stack, tmp_path, name, source) for name, (source, _, _) in ENDS.items()}
        for name, process in running.items():
            with case(name):
                _, status, lines = ENDS[name]
                assert process.wait(120) == status
                text = process.text
                for line in lines:
                    assert line in text
                    text = text[text.index(line) :]


def test_scripts_end_soon_when_they_are_asked_to(tmp_path: Path) -> None:
    with ExitStack() as stack:
        running = {name: start(stack, tmp_path, name, HEAD + source) for name, source in INTERRUPTED.items()}
        for process in running.values():
            wait_until(lambda process=process: "up" in process.text, 60)  # type: ignore[misc]
        began = time.monotonic()
        for name, process in running.items():
            process.signal(signal.SIGTERM if name == "waits" else signal.SIGINT)
        for name, process in running.items():
            with case(name):
                assert process.wait(60) == 0
                text = process.text
                assert text.count("hook False") == 1
                assert "Traceback" not in text, text
                assert ("after" in text) == ("after" in INTERRUPTED[name])
        assert time.monotonic() - began < SECONDS * len(INTERRUPTED)
