"""Reads and writes metadata.yaml, which makes a folder of MCAP files a rosbag2 bag (version 9)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from models.yaml_reader import read_yaml
from services.bag.channel import Channel, qos_text
from services.runtime.errors import BadInput

METADATA_FILE = "metadata.yaml"
VERSION = 9
_KEYS = (
    *("version", "storage_identifier", "relative_file_paths", "duration", "starting_time", "message_count"),
    "topics_with_message_count",
)
_LATER_KEYS = {"compression_format": 3, "compression_mode": 3, "files": 5, "custom_data": 6, "ros_distro": 8}
"""The keys that rosbag2 requires in every metadata.yaml (``_KEYS``), and those that it requires from a version on."""
MAX_METADATA_SIZE = 1 << 22
"""Maximum bytes of a metadata.yaml; a topic takes about 500, and 0.3 ms to read."""


class FileStats(NamedTuple):
    """One file of a bag; ``start`` and ``end`` are log times [ns]."""

    name: str
    size: int
    messages: int
    start: int
    end: int
    topics: Mapping[Channel, int]


def metadata_text(files: Sequence[FileStats]) -> str:
    """Return the text of metadata.yaml for these files, in this order."""
    counts: dict[Channel, int] = {}
    for file in files:
        for channel, count in file.topics.items():
            counts[channel] = counts.get(channel, 0) + count
    held = [file for file in files if file.messages]
    start, end = min((file.start for file in held), default=0), max((file.end for file in held), default=0)
    tree = {
        "version": VERSION,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": sum(file.messages for file in files),
        "topics_with_message_count": [_topic_entry(channel, count) for channel, count in counts.items()],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name for file in files],
        "files": [
            {
                "path": file.name,
                "starting_time": {"nanoseconds_since_epoch": file.start},
                "duration": {"nanoseconds": file.end - file.start},
                "message_count": file.messages,
            }
            for file in files
        ],
        "custom_data": {},
        "ros_distro": "jazzy",
    }
    return yaml.safe_dump({"rosbag2_bagfile_information": tree}, sort_keys=False)


class FileList(NamedTuple):
    """The files listed in metadata.yaml, in order; None if it is missing or damaged; ``problem`` describes damage."""

    names: list[str] | None = None
    problem: str = ""


def read_file_list(folder: Path) -> FileList:
    """Read the list of files from the metadata.yaml of a folder."""
    file = folder / METADATA_FILE
    if not file.exists():
        return FileList()
    try:
        if file.stat().st_size > MAX_METADATA_SIZE:
            return FileList(None, f"{file} has {file.stat().st_size} bytes, the limit is {MAX_METADATA_SIZE}")
        tree: Any = read_yaml(file.read_text(encoding="utf-8"), f"{file} is damaged")
        found = tree["rosbag2_bagfile_information"]
        names = found["relative_file_paths"]
    except OSError as error:
        return FileList(None, f"{file} cannot be read: {error.strerror}")
    except BadInput as error:
        return FileList(None, str(error))
    except ValueError as error:
        return FileList(None, f"{file} is damaged: {error}")
    except (KeyError, TypeError):
        return FileList(None, f"{file} is cut or damaged: it does not say which files the bag has")
    if not isinstance(names, list) or not all(isinstance(each, str) for each in names):
        return FileList(None, f"{file} is damaged: relative_file_paths is not a list of names")
    # Before version 4 of the file, rosbag2 wrote them with the folder's own name.
    return FileList([each.removeprefix(f"{folder.resolve().name}/") for each in names], _cut(file, found))


def _cut(file: Path, found: Mapping[str, Any]) -> str:
    """Return the evidence that the end of the file is missing; empty if there is none."""
    version = found.get("version")
    later = [key for key, since in _LATER_KEYS.items() if isinstance(version, int) and version >= since]
    absent = [key for key in (*_KEYS, *later) if key not in found]
    files, names = found.get("files"), found["relative_file_paths"]
    if not absent and isinstance(files, list) and "files" in later and len(files) < len(names):
        return f"{file} is cut off or damaged: it lists {len(files)} of {len(names)} files"
    return f"{file} is cut or damaged: it has no {absent[0]}" if absent else ""


def _topic_entry(channel: Channel, count: int) -> dict[str, Any]:
    return {
        "topic_metadata": {
            "name": channel.topic,
            "type": channel.stored.ros_type,
            "serialization_format": channel.stored.encoding,
            "offered_qos_profiles": read_yaml(qos_text(channel.quality)),
            "type_description_hash": "",
        },
        "message_count": count,
    }
