"""Damaged bags, decompression bombs and foreign writers: a clear error, in bounded memory and time."""

from __future__ import annotations

import tracemalloc
from io import BytesIO
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from mcap.records import Channel as ChannelRecord
from mcap.records import Chunk, Header, Schema
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import Reader

from deploy.bag_export import export_bag
from messages.geometry import Twist
from messages.std import Time
from messages.topics import Quality
from services.bag.channel import Channel, channel_of
from services.bag.csv_export import MAX_COLUMNS, export_csv
from services.bag.info import bag_info
from services.bag.mcap_reader import MAX_RECORD_SIZE, MAX_REPORTED_PROBLEMS
from services.bag.mcap_writer import MAGIC, encode_record
from services.bag.reader import GAP_NS, open_bag
from services.bag.writer import BagWriter, file_number
from services.player import PlayerParameters
from services.player.playback import MAX_TIME_NS, Playback, select
from services.runtime.errors import BadInput
from tests.services.bag.sample_bags import START, make_bag

S = 10**9
EMPTY = "geometry_msgs/msg/Twist", b"\0\1\0\0" + bytes(48)
TWIST = channel_of("/t", Twist, Quality.SENSOR).schema.encode()


def foreign(file: Path, *messages: tuple[str, int, int], kind: str = EMPTY[0], schema: bytes = TWIST) -> Path:
    """Write an unchunked foreign file from (topic, log time, publish time), with one channel for each topic."""
    with file.open("wb") as stream:
        writer = McapWriter(stream, use_chunking=False, enable_crcs=False)
        writer.start("ros2", "somebody")
        known = writer.register_schema(kind, "ros2msg", schema)
        channels: dict[str, int] = {}
        for number, (topic, logged, published) in enumerate(messages):
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "cdr", known)
            writer.add_message(channels[topic], logged, EMPTY[1], published, number)
        writer.finish()
    return file


def packed(file: Path, data: bytes, compression: str, size: int) -> Path:
    """Write a file with one chunk that claims ``size`` bytes uncompressed."""
    chunk = Chunk(
        compression=compression,
        data=data,
        message_start_time=0,
        message_end_time=0,
        uncompressed_crc=0,
        uncompressed_size=size,
    )
    file.write_bytes(MAGIC + encode_record(Header(profile="ros2", library="x")) + encode_record(chunk))
    return file


def look(file: Path) -> None:
    """Do all the reading that precedes playing a bag; only BadInput may be raised."""
    try:
        bag = open_bag(file)
        bag_info(bag)
        choice = select(bag.channels(), PlayerParameters(bag=str(file)))
        for _ in Playback(bag, choice, 0.0, 0.0).messages():
            pass
    except BadInput:
        pass


@pytest.mark.slow
def test_no_flipped_bit_and_no_cut_ends_the_reading(tmp_path: Path) -> None:
    """Flips a bit in every 17th byte, and cuts there, in a file of ours and in one without chunks and checksums."""
    ours = (make_bag(tmp_path / "bag", 0.04) / "bag_0.mcap").read_bytes()
    theirs = foreign(tmp_path / "theirs.mcap", ("/t", S, S), ("u", 2 * S, 2 * S), ("/t", 3 * S, 3 * S)).read_bytes()
    file = tmp_path / "damaged.mcap"
    for data in (ours, theirs):
        for at in range(0, len(data), 17):
            flipped = bytearray(data)
            flipped[at] ^= 1 << (at // 17 % 8)
            for damaged in (bytes(flipped), data[:at]):
                file.write_bytes(damaged)
                look(file)
    # The high bit of a length in a chunk's header: a library then requests more from its stream than a C integer holds.
    flipped = bytearray(ours)
    flipped[ours.index(b"zstd") + 4 + 7] ^= 0x80
    file.write_bytes(flipped)
    assert "damaged at byte" in bag_info(open_bag(file)).troubles[0]


def test_a_chunk_that_is_not_read_is_missed(tmp_path: Path) -> None:
    """The flipped bit turns the chunk into a record of an unknown kind, which readers skip."""
    data = bytearray((make_bag(tmp_path / "bag", 0.1) / "bag_0.mcap").read_bytes())
    at = data.index(b"zstd") - 41
    assert data[at] == 6
    data[at] = 0x46
    (tmp_path / "lost.mcap").write_bytes(data)
    bag = open_bag(tmp_path / "lost.mcap")
    assert list(bag.entries()) == []
    assert bag.problems == [f"{tmp_path / 'lost.mcap'} is damaged: its summary counts 25 messages, 0 can be read"]


def test_what_is_packed_to_burst_takes_no_more_than_it_claims(tmp_path: Path) -> None:
    big = bytes(64 << 20)
    untold = BytesIO()
    with zstandard.ZstdCompressor().stream_writer(untold, closefd=False) as stream:
        stream.write(big)
    for name, data, compression, size, reason in (
        ("told", zstandard.compress(big), "zstd", 1000, "has 67108864 bytes, unpacked, instead of 1000"),
        ("untold", untold.getvalue(), "zstd", 1000, "a chunk of 1000 bytes whose data unpacks to more"),
        ("lz4", lz4.frame.compress(big), "lz4", 1000, "a chunk of 1000 bytes whose data unpacks to more"),
        ("less", zstandard.compress(b"x"), "zstd", 1000, "has 1 bytes, unpacked, instead of 1000"),
        ("huge", b"", "", MAX_RECORD_SIZE + 1, "the limit is 268435456"),
    ):
        file = packed(tmp_path / f"{name}.mcap", data, compression, size)
        tracemalloc.start()
        try:
            troubles = bag_info(open_bag(file)).troubles
            peak = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
        assert reason in troubles[0], name
        assert peak < 16 << 20, name


def test_a_thousand_damaged_messages_are_told_in_a_few_lines(tmp_path: Path) -> None:
    with (tmp_path / "many.mcap").open("wb") as stream:
        stream.write(MAGIC + encode_record(Header(profile="ros2", library="x")))
        stream.write(encode_record(Schema(id=1, name="x/msg/Y", encoding="ros2msg", data=b"\xff")))
        stream.write(encode_record(ChannelRecord(id=1, topic="/t", message_encoding="cdr", metadata={}, schema_id=1)))
        for _ in range(1000):
            stream.write(b"\5" + (22).to_bytes(8, "little") + b"\1\0" + bytes(20))
    troubles = bag_info(open_bag(tmp_path / "many.mcap")).troubles
    assert len(troubles) == MAX_REPORTED_PROBLEMS + 2
    assert f"damaged in {1001 - MAX_REPORTED_PROBLEMS} more places" in troubles[-1]


def test_a_table_has_no_more_columns_than_spreadsheets_have(tmp_path: Path) -> None:
    schema = b"E[30] x\n===\nMSG: x/E\nF[600] x\n===\nMSG: x/F\nuint8 x\n"
    file = tmp_path / "wide.mcap"
    with file.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start("ros2", "x")
        channel = writer.register_channel("/t", "cdr", writer.register_schema("x/msg/T", "ros2msg", schema))
        writer.add_message(channel, 1, b"\0\1\0\0" + bytes(18000), 1, 1)
        writer.finish()
    told = export_csv(open_bag(file), tmp_path / "csv", lambda _: True)
    assert (told[0].rows, told[0].reason) == (1, "columns beyond 16384 are left out")
    assert len((tmp_path / "csv" / "t.csv").read_text().splitlines()[0].split(",")) == MAX_COLUMNS + 2


def test_topics_without_a_slash_are_played_and_exported(tmp_path: Path) -> None:
    file = foreign(tmp_path / "x.mcap", ("cmd_vel", S, S), ("/odd-name", S, S), ("/cmd_vel", 2 * S, 2 * S))
    bag = open_bag(file)
    assert {each.topic: (each.playable, each.reason) for each in bag_info(bag).topics} == {
        "cmd_vel": (True, ""),
        "/cmd_vel": (True, ""),
        "/odd-name": (
            False,
            "'/odd-name' is not a name: '-' at position 4: a name has letters, digits, '_' and '/' only",
        ),
    }
    for topics in ((), ("cmd_vel",), ("/cmd_vel",)):
        choice = select(bag.channels(), PlayerParameters(bag=str(file), topics=topics))
        assert [each.name for each in choice.played] == ["/cmd_vel", "/cmd_vel"]
        assert len(list(Playback(bag, choice, 0.0, 0.0).messages())) == 2
    assert len(export_bag(file, "csv", str(tmp_path / "csv"), ("cmd_vel",)).text.splitlines()) == 2
    two = [channel_of("/t", Twist, Quality.SENSOR), channel_of("/t", Time, Quality.SENSOR)]
    choice = select(two, PlayerParameters(bag="two"))
    assert choice.rejected == {
        "/t": "it is played as geometry_msgs/Twist; its messages of type builtin_interfaces/Time are not: "
        "a topic has one type"
    }


def test_start_and_span_of_times_that_are_zero_or_in_no_order(tmp_path: Path) -> None:
    for times, start, span in (((0, 5 * S, 9 * S), 0.0, 9.0), ((7 * S, 3 * S, 5 * S), 3.0, 4.0)):
        told = bag_info(open_bag(foreign(tmp_path / "x.mcap", *(("/t", each, each) for each in times))))
        assert (told.start, told.wall_seconds) == (start, span)


def test_simulated_time_that_interleaves_is_counted_once(tmp_path: Path) -> None:
    """Stamps of two publishers 0.4 s apart alternate; a reset, or a message without a time, starts a new span."""
    lines = [(f"/{tick % 2}", tick * S // 10, tick * S // 10 - tick % 2 * 4 * S // 10 + S) for tick in range(101)]
    told = bag_info(open_bag(foreign(tmp_path / "x.mcap", *lines)))
    assert told.seconds == pytest.approx(10.3)
    assert [each.rate for each in told.topics] == pytest.approx([5.0, 5.0])
    lines += [(topic, logged + 11 * S, published) for topic, logged, published in lines]
    told = bag_info(open_bag(foreign(tmp_path / "x.mcap", *lines)))
    assert told.seconds == pytest.approx(20.6)
    assert [each.rate for each in told.topics] == pytest.approx([5.0, 5.0])
    file = foreign(tmp_path / "x.mcap", ("/t", S, 0), *(("/t", START + k * S, START + k * S) for k in range(3)))
    assert (bag_info(open_bag(file)).seconds, GAP_NS < START) == (2.0, True)


def test_a_time_that_no_clock_tells_is_left_out(tmp_path: Path) -> None:
    file = foreign(tmp_path / "x.mcap", ("/t", S, S), ("/t", 2 * S, MAX_TIME_NS + 1), ("/t", 3 * S, 3 * S))
    bag = open_bag(file)
    playback = Playback(bag, select(bag.channels(), PlayerParameters(bag=str(file))), 0.0, 0.0)
    assert [cue.bag_time.position for cue in playback.messages()] == [0, 2 * S]
    assert playback.out_of_range == {"/t": 1}


def test_types_of_requests_keep_their_names(tmp_path: Path) -> None:
    kinds = ("std_srvs/srv/Empty_Request", "nav2_msgs/action/Spin_Feedback", "geometry_msgs/msg/Twist")
    for kind in kinds:
        file = foreign(tmp_path / "x.mcap", ("/t", S, S), kind=kind)
        assert bag_info(open_bag(file)).topics[0].type == kind
        name = kind.replace("/", "_")
        export_bag(file, "rosbag2", str(tmp_path / name))
        with Reader(tmp_path / name) as reader:
            assert [each.msgtype for each in reader.connections] == [kind]
    assert Channel("/t", "").ros_type == ""


@pytest.mark.slow
def test_what_metadata_names_and_is_missing_is_told(tmp_path: Path) -> None:
    """Existing files are still read; ``bag info`` and ``play`` exit with status 1 for any trouble."""
    with BagWriter(tmp_path / "bag", max_duration=0.1) as made:
        for tick in range(10):
            made.write(channel_of("/t", Twist, Quality.SENSOR), tick, START + tick * S // 10, tick, EMPTY[1])
    metadata = tmp_path / "bag" / "metadata.yaml"
    whole = metadata.read_text()
    assert bag_info(open_bag(tmp_path / "bag")).troubles == ()
    metadata.write_text(whole.replace("- bag_0", "- bag/bag_0"))  # as rosbag2 before version 4
    assert bag_info(open_bag(tmp_path / "bag")).troubles == ()
    (tmp_path / "bag" / "bag_2.mcap").unlink()
    told = bag_info(open_bag(tmp_path / "bag"))
    assert told.troubles == (
        f"{tmp_path / 'bag' / 'bag_2.mcap'} is missing, though metadata.yaml names it: was the bag copied completely?",
    )
    assert told.messages == 8
    for text, reason in (
        (whole[: whole.index("relative_file_paths")], "is cut or damaged: it does not say which files the bag has"),
        ("a: [", "is damaged: while parsing"),
        ("[" * 20_000, "is damaged"),
        ("", "is cut or damaged"),
        ("a: 2001-99-99", "is damaged: month must be"),
        ("rosbag2_bagfile_information: {relative_file_paths: [1]}", "is not a list of names"),
    ):
        metadata.write_text(text)
        troubles = open_bag(tmp_path / "bag").known_problems
        assert [reason in each for each in troubles] == [True], (text[:40], troubles)
    metadata.unlink()
    assert open_bag(tmp_path / "bag").known_problems == ()


@pytest.mark.slow
def test_metadata_whose_end_is_missing_is_told_and_compressed_files_are_known(tmp_path: Path) -> None:
    """Each of these is valid YAML, and most list all files: rosbag2 rejects them."""
    with BagWriter(tmp_path / "bag", max_duration=0.1) as made:
        for tick in range(4):
            made.write(channel_of("/t", Twist, Quality.SENSOR), tick, START + tick * S // 10, tick, EMPTY[1])
    metadata = tmp_path / "bag" / "metadata.yaml"
    whole = metadata.read_text()
    for text, reason in (
        (whole[: whole.index("  files:")], "is cut or damaged: it has no files"),
        (whole[: whole.index("  - path: bag_1")], "is cut or damaged: it has no custom_data"),
        (whole[: whole.index("  ros_distro")], "is cut or damaged: it has no ros_distro"),
        (whole.replace("version: 9", "version: 4").replace("storage_identifier", "x"), "it has no storage_identifier"),
        (whole[: whole.index("  - path: bag_1")] + "  custom_data: {}\n  ros_distro: x\n", "it lists 1 of"),
    ):
        metadata.write_text(text)
        assert [reason in each for each in open_bag(tmp_path / "bag").known_problems] == [True], (reason, text[-60:])
    metadata.write_text(whole.replace(".mcap", ".mcap.zstd"))  # of a bag that was decompressed
    unpacked = bag_info(open_bag(tmp_path / "bag"))
    assert (unpacked.messages, unpacked.troubles) == (4, ())
    packed = (tmp_path / "bag" / "bag_1.mcap").rename(tmp_path / "bag" / "bag_1.mcap.zstd")
    assert bag_info(open_bag(tmp_path / "bag")).troubles == (
        f"{packed} is compressed as a whole: unpack it first, with 'zstd -d'",
    )


def test_names_of_files_that_are_no_numbers(tmp_path: Path) -> None:
    assert [file_number(Path(name)) for name in ("x_².mcap", "x_12.mcap", "x_٣.mcap", "x.mcap")] == [-1, 12, -1, -1]
    (tmp_path / "x_².mcap").mkdir()
    with pytest.raises(BadInput, match=r"is not a bag: no \.mcap file"):
        open_bag(tmp_path)
    (tmp_path / "x_0.mcap.zstd").touch()
    with pytest.raises(BadInput, match="compressed as a whole: unpack it first"):
        open_bag(tmp_path)
    with pytest.raises(BadInput, match="it is neither a file nor a folder"):
        open_bag(Path("/dev/null"))
