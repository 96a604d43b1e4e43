"""Explains imports that are not available."""

from __future__ import annotations

from importlib.util import find_spec

from services.script.workspace import Workspace

_PIP = {
    "PIL": "pillow",
    "bluetooth": "pybluez",
    "bs4": "beautifulsoup4",
    "cv2": "opencv-python-headless",
    "gi": "PyGObject",
    "google": "protobuf",
    "imutils": "imutils",
    "keras": "keras",
    "nltk": "nltk",
    "pandas": "pandas",
    "paho": "paho-mqtt",
    "playsound": "playsound",
    "pygame": "pygame",
    "pynput": "pynput",
    "pyttsx3": "pyttsx3",
    "requests": "requests",
    "scipy": "scipy",
    "serial": "pyserial",
    "shapely": "shapely",
    "simple_pid": "simple-pid",
    "skimage": "scikit-image",
    "sklearn": "scikit-learn",
    "speech_recognition": "SpeechRecognition",
    "sympy": "sympy",
    "tensorflow": "tensorflow",
    "tornado": "tornado",
    "torch": "torch",
    "tqdm": "tqdm",
    "transforms3d": "transforms3d",
    "usb": "pyusb",
    "websocket": "websocket-client",
    "wx": "wxPython",
    "zmq": "pyzmq",
}
_INSTEAD = {
    "interactive_markers": "there are no interactive markers; goals are set in the panel's map",
    "move_base_msgs": "put the package into the script's workspace to use its messages",
    "moveit_commander": "motion planning is not provided; joints are moved by trajectories "
    "(control_msgs/FollowJointTrajectory) or by position commands",
    "nodelet": "nodelets are C++",
    "python_qt_binding": "there is no rqt; ./elea panel shows topics, plots and parameters",
    "qt_gui": "there is no rqt; ./elea panel shows topics, plots and parameters",
    "rclpy": "it is the client library of ROS 2; only ROS 1 programs are supported",
    "rosbridge_library": "external programs connect through the web panel or Elea's Python client",
    "rqt_gui": "there is no rqt; ./elea panel shows topics, plots and parameters",
    "rqt_gui_py": "there is no rqt; ./elea panel shows topics, plots and parameters",
    "rviz": "there is no rviz; ./elea view shows the same",
    "xmlrpclib": "it is a module of Python 2 (xmlrpc.client in Python 3), and there is no ROS master to call",
}
MODERN = {
    "BaseHTTPServer": "http.server",
    "ConfigParser": "configparser",
    "HTMLParser": "html.parser",
    "Queue": "queue",
    "SimpleHTTPServer": "http.server",
    "SimpleXMLRPCServer": "xmlrpc.server",
    "SocketServer": "socketserver",
    "StringIO": "io",
    "ScrolledText": "tkinter.scrolledtext",
    "Tkconstants": "tkinter.constants",
    "Tkinter": "tkinter",
    "__builtin__": "builtins",
    "cPickle": "pickle",
    "cStringIO": "io",
    "commands": "subprocess",
    "cookielib": "http.cookiejar",
    "copy_reg": "copyreg",
    "exceptions": "builtins",
    "httplib": "http.client",
    "thread": "_thread",
    "tkColorChooser": "tkinter.colorchooser",
    "tkFileDialog": "tkinter.filedialog",
    "tkMessageBox": "tkinter.messagebox",
    "tkSimpleDialog": "tkinter.simpledialog",
    "ttk": "tkinter.ttk",
    "urllib2": "urllib.request",
    "urlparse": "urllib.parse",
}
"""Python 3 names of Python 2 modules."""


def explain_missing(name: str, place: str, workspace: Workspace | None) -> str:
    """Return the error text for a missing module; ``place`` is the importing line, e.g. ``arm.py:4``."""
    top = name.partition(".")[0]
    if workspace is not None and (folder := workspace.package_path(top)) is not None:
        inner = name.partition(".")[2]
        if inner:
            return f"package `{top}` ({folder}) has no module `{inner}` (import in {place})"
        return f"package `{top}` ({folder}) has no Python modules in src/{top} (import in {place})"
    if top in _PIP:
        return (
            f"`{top}` is not installed (import in {place}): "
            f"uv pip install --python .venv/bin/python {_PIP[top]} in the project's folder"
        )
    if top in _INSTEAD:
        return f"`{top}` is not part of Elea (import in {place}): {_INSTEAD[top]}"
    if "." in name and _there(top):
        return f"`{top}` has no module `{name.partition('.')[2]}` (import in {place})"
    if name.endswith(".cfg"):
        return (
            f"the package `{top}` of this .cfg was not found (import in {place}): "
            "put it into the script's workspace, or name its folder in ROS_PACKAGE_PATH"
        )
    if top.endswith(("_msgs", "_srvs")) or name.partition(".")[2].startswith(("msg", "srv")):
        return (
            f"the message package `{top}` was not found (import in {place}): "
            "put it into the script's workspace, or name its folder in ROS_PACKAGE_PATH"
        )
    return (
        f"`{name}` is not part of Elea, nor in the script's folder or workspace (import in {place}); if it is a "
        f"Python library: uv pip install --python .venv/bin/python {top}"
    )


def _there(name: str) -> bool:
    try:
        return find_spec(name) is not None
    except (ImportError, ValueError):
        return False
