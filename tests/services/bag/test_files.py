"""Bag files: independent readers read them completely, and our reader reads a torn file up to its last whole chunk."""

from __future__ import annotations

import itertools
import json
import re
from pathlib import Path
from types import SimpleNamespace

import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability
from rosbags.rosbag2 import Reader

from messages.rosgraph import Clock
from messages.topics import Quality
from services.bag import mcap_writer
from services.bag.channel import Channel, quality_of, raw_channel
from services.bag.info import bag_info
from services.bag.reader import Bag, Entry, MessageDecoder, is_sidecar, open_bag
from services.bag.writer import BagWriter
from tests.services.bag.sample_bags import START, STEP, drive_messages, make_bag, write_messages


def clocks(entries: list[Entry]) -> list[Clock]:
    """Return the decoded messages of /clock, merged with their sidecars."""
    typed = MessageDecoder()
    found = [typed.decode(each) for each in entries if each.channel.topic.startswith("/clock")]
    return [each for each in found if isinstance(each, Clock)]


def entries(path: Path) -> tuple[list[Entry], Bag]:
    bag = open_bag(path)
    return list(bag.entries()), bag


def test_other_readers_find_every_message_and_every_time(tmp_path: Path) -> None:
    folder = make_bag(tmp_path / "bag")
    ours, bag = entries(folder)
    assert bag.problems == []
    with AnyReader([folder]) as reader:
        theirs = [(c.topic, t, bytes(data)) for c, t, data in reader.messages()]
        assert reader.message_count == len(ours) == 101 * 4 + 1
    assert theirs == [(each.channel.topic, each.log_time, each.data) for each in ours]
    with (folder / "bag_0.mcap").open("rb") as stream:
        found = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = found.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == len(ours)
        assert found.get_header().profile == "ros2"
        times = [(each.log_time, each.publish_time) for _, _, each, _ in found.iter_decoded_messages(["/r/cmd_vel"])]
    assert times == [(START + tick * STEP, tick * STEP) for tick in range(101)]
    with (folder / "bag_0.mcap").open("rb") as stream:  # every record, its checksums and its order
        assert sum(1 for _ in StreamReader(stream, validate_crcs=True).records) > len(ours)


def test_rosbag2_finds_its_metadata_and_what_is_latched(tmp_path: Path) -> None:
    folder = make_bag(tmp_path / "bag")
    with Reader(folder) as reader:
        assert (reader.message_count, reader.duration, reader.start_time) == (101 * 4 + 1, 2_000_000_001, START)
        durable = {each.topic: each.ext.offered_qos_profiles[0].durability for each in reader.connections}
    assert durable.pop("/r/robot_description") == QosDurability.TRANSIENT_LOCAL
    assert set(durable.values()) == {QosDurability.VOLATILE}


def test_the_clock_keeps_tick_epoch_and_pause(tmp_path: Path) -> None:
    found, _ = entries(make_bag(tmp_path / "bag", 0.1))
    assert clocks(found) == [message for topic, message, _ in drive_messages(0.1) if topic == "/clock"]


@pytest.mark.parametrize("share", [0.999, 0.7, 0.5, 0.1])
def test_a_torn_file_is_read_up_to_its_last_whole_chunk(tmp_path: Path, share: float) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for number in range(10):
            write_messages(bag, [(t, m, now + number * STEP) for t, m, now in drive_messages(0.0)])
            bag.flush()
    whole, _ = entries(tmp_path / "bag")
    file = tmp_path / "bag" / "bag_0.mcap"
    data = file.read_bytes()
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(data[: round(len(data) * share)])
    found, bag_read = entries(torn)
    assert found == whole[: len(found)]
    assert len(found) % 5 == 0, "chunks come whole"
    assert len(found) >= {0.999: 50, 0.7: 40, 0.5: 15, 0.1: 0}[share]
    assert "torn.mcap is truncated" in bag_read.problems[0]


def test_messages_are_on_the_disk_within_a_second(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now = 0.0
    monkeypatch.setattr(mcap_writer, "time", SimpleNamespace(monotonic=lambda: now))
    with BagWriter(tmp_path / "bag") as bag:
        write_messages(bag, drive_messages(0.0))
        bag.flush_due()
        before, _ = entries(tmp_path / "bag")
        now = 0.9
        bag.flush_due()
        after, _ = entries(tmp_path / "bag")
    assert (before, after) == ([], entries(tmp_path / "bag")[0])


def test_every_cut_is_survived(tmp_path: Path) -> None:
    """Cut at every byte, the reader neither fails nor invents messages."""
    whole, _ = entries(make_bag(tmp_path / "bag", 0.1))
    data = (tmp_path / "bag" / "bag_0.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    for length in range(8, len(data), 37):
        cut.write_bytes(data[:length])
        found, bag = entries(cut)
        assert found in ([], whole)
        assert "truncated" in bag.problems[0]


def test_a_damaged_chunk_is_left_out_and_told(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for number in range(3):
            write_messages(bag, [(t, m, now + number * STEP) for t, m, now in drive_messages(0.0)])
            bag.flush()
    whole, _ = entries(tmp_path / "bag")
    file = tmp_path / "bag" / "bag_0.mcap"
    data = bytearray(file.read_bytes())
    second = [found.start() for found in re.finditer(rb"\x28\xb5\x2f\xfd", data)][1]  # start of zstd data
    data[second + 60] ^= 0xFF
    file.write_bytes(data)
    found, read = entries(file)
    assert found == whole[:5] + whole[10:]
    assert "damaged at byte" in read.problems[0]


def test_files_are_split_by_size(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", max_size=1 << 16) as bag:
        numbers = itertools.count()
        channel = raw_channel("/noise", "x_msgs/Noise", Quality.EVENT)
        for number in numbers:
            bag.write(
                channel, number, START + number, number, bytes((number * 7919 + k * k) % 251 for k in range(2000))
            )
            if bag.files > 3:
                break
    files = sorted((tmp_path / "bag").glob("*.mcap"))
    assert [each.name for each in files] == [f"bag_{k}.mcap" for k in range(4)]
    assert all(each.stat().st_size <= 1 << 16 for each in files[:-1])
    found, _ = entries(tmp_path / "bag")
    assert [each.sequence for each in found] == list(range(number + 1))
    with AnyReader([tmp_path / "bag"]) as reader:
        assert reader.message_count == number + 1


def test_files_are_split_by_time(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", max_duration=0.5) as bag:
        write_messages(bag, drive_messages(2.0))
    spans = [[each.log_time for each in entries(file)[0]] for file in sorted((tmp_path / "bag").glob("*.mcap"))]
    assert [round((span[-1] - span[0]) / 1e9, 2) for span in spans[:-1]] == [0.5] * (len(spans) - 1)
    assert len(entries(tmp_path / "bag")[0]) == 405


def test_a_bag_leaves_room_on_the_disk_and_goes_on_when_there_is_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    free = 10_000_000
    monkeypatch.setattr(mcap_writer, "disk_space", lambda _: (free, 9_999_000))
    with BagWriter(tmp_path / "bag") as bag:
        write_messages(bag, [("/clock", Clock(), 0)])
        bag.flush()
        free = 9_999_100
        write_messages(bag, [("/clock", Clock(), tick) for tick in range(1, 8)])
        with pytest.raises(OSError, match="less than 10 MB are left on it, which are kept for others"):
            bag.flush()
        assert bag.unwritten == 14, "of each clock, what ROS knows and what it does not"
        free = 20_000_000
        write_messages(bag, [("/clock", Clock(), 9)])
    read, told = entries(tmp_path / "bag")
    assert ([each.publish_time for each in read], told.problems) == ([0, 0, 9, 9], [])


@pytest.mark.parametrize(("limit", "most"), [("MAX_CHUNKS", 4), ("MAX_INDEX_SIZE", 310)])
def test_an_index_that_has_grown_long_ends_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str, most: int
) -> None:
    """A file's index is kept in memory until the file ends: that of a week would be too large."""
    monkeypatch.setattr(mcap_writer, limit, most)
    with BagWriter(tmp_path / "bag") as bag:
        for tick in range(10):
            write_messages(bag, [("/clock", Clock(), tick)])
            bag.flush()
    read, told = entries(tmp_path / "bag")
    assert ([each.publish_time for each in read[::2]], told.problems) == (list(range(10)), [])
    assert len(told.files) == 3
    with AnyReader([tmp_path / "bag"]) as reader:
        assert reader.message_count == 20


def test_it_goes_on_in_a_folder_that_is_there(tmp_path: Path) -> None:
    make_bag(tmp_path / "bag", 0.1)
    with BagWriter(tmp_path / "bag", resume=True) as bag:
        write_messages(bag, drive_messages(0.1), START + 10**9)
    found, _ = entries(tmp_path / "bag")
    assert len(found) == 50
    assert [each.log_time for each in found] == sorted(each.log_time for each in found)
    with AnyReader([tmp_path / "bag"]) as reader:
        assert reader.message_count == 50, "also for those who go by metadata.yaml"
        assert len(list(reader.messages())) == 50


def test_losses_of_all_sessions_of_a_resumed_recording_are_added(tmp_path: Path) -> None:
    for lost, unwritten in (({"/a": 5}, 3), ({"/a": 1, "/b": 2}, 4), ({}, 0)):
        with BagWriter(tmp_path / "bag", resume=True) as bag:
            write_messages(bag, drive_messages(0.1))
            bag.metadata |= {"lost": json.dumps(lost), "unfit": "{}", "unwritten": str(unwritten), "by": str(unwritten)}
    found = open_bag(tmp_path / "bag")
    told = bag_info(found)
    assert (told.lost, told.unwritten) == ({"/a": 6, "/b": 2}, 7)
    assert found.metadata["by"] == "0", "of everything else the last file counts"


def test_a_torn_file_is_left_out_of_what_others_read_and_not_of_what_we_do(tmp_path: Path) -> None:
    file = make_bag(tmp_path / "bag", 0.1) / "bag_0.mcap"
    file.write_bytes(file.read_bytes()[:-100])
    with BagWriter(tmp_path / "bag", resume=True) as bag:
        write_messages(bag, drive_messages(0.1), START + 10**9)
    with AnyReader([tmp_path / "bag"]) as reader:
        assert reader.message_count == 25
    assert len(entries(tmp_path / "bag")[0]) == 50


def test_what_travelled_raw_is_kept_raw(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        bag.write(raw_channel("/x", "my_msgs/Thing", Quality.LATCHED), 1, START, 5, b"\x81\xa1a\x01")
    (entry,), _ = entries(tmp_path / "bag")
    assert (entry.channel.encoding, entry.channel.type, entry.data) == ("msgpack", "my_msgs/Thing", b"\x81\xa1a\x01")
    assert entry.channel.quality is Quality.LATCHED
    assert not is_sidecar(entry.channel)
    with AnyReader([tmp_path / "bag"]) as reader:
        ((connection, _, data),) = reader.messages()
        kept = reader.deserialize(data, connection.msgtype)
    assert (kept.type, kept.data.tobytes()) == ("my_msgs/Thing", b"\x81\xa1a\x01")


@pytest.mark.parametrize("quality", list(Quality))
def test_how_messages_travelled_is_known_again(quality: Quality) -> None:
    metadata = Channel("/t", "std_msgs/String", quality=quality).metadata
    assert quality_of(metadata) is quality
    del metadata["elea_quality"]  # as other recorders write bags
    assert quality_of(metadata) is (Quality.LATCHED if quality is Quality.LATCHED else Quality.EVENT)
    assert quality_of({"offered_qos_profiles": "- reliability: 2\n  durability: 2\n"}) is Quality.SENSOR
    assert quality_of({"offered_qos_profiles": "- reliability: 1\n  durability: 1\n"}) is Quality.LATCHED
