"""Reads bags of ROS 2, .mcap and .db3, without ROS: the messages that a recording of an RGB-D camera is made of.

    bag = ros2_bag.Bag("run.mcap")          # or run.db3, or the folder that holds them
    bag.topics                              # name -> .msg_type, e.g. sensor_msgs/Image, and .message_count
    for topic, message, _ in bag.read_messages(topics=["/camera/color/image_raw"]):
        ...                                 # with the names of rosbag: message.header.stamp.secs, message.K

Standard library only; chunks of .mcap that are compressed need python3-lz4 or python3-zstandard.
"""
import collections
import pathlib
import re
import sqlite3
import struct
import sys
from types import SimpleNamespace

MAGIC = b"\x89MCAP0\r\n"
SCHEMA, CHANNEL, MESSAGE, CHUNK = 3, 4, 5, 6  # kinds of records of a .mcap file


class BagError(Exception):
    pass


class Cdr:
    """Values one after another as CDR has them: each at a multiple of its size, counted from the end of the first four bytes."""

    def __init__(self, data):
        if len(data) < 4 or data[0] != 0 or data[1] > 1:
            raise BagError("a message is not in plain CDR")
        self.data, self.at, self.order = memoryview(data), 4, "<" if data[1] == 1 else ">"

    def numbers(self, kind, count=1):
        size = struct.calcsize("=" + kind)
        self.at += -(self.at - 4) % size
        values = struct.unpack_from(f"{self.order}{count}{kind}", self.data, self.at)
        self.at += count * size
        return values

    def number(self, kind):
        return self.numbers(kind)[0]

    def bytes(self):
        count = self.number("I")
        if self.at + count > len(self.data):
            raise BagError("a message ends in the middle of its data")
        self.at += count
        return bytes(self.data[self.at - count:self.at])

    def text(self):
        return self.bytes().rstrip(b"\0").decode("utf-8", "replace")

    def header(self):
        secs, nsecs = self.number("i"), self.number("I")
        return SimpleNamespace(stamp=SimpleNamespace(secs=secs, nsecs=nsecs), frame_id=self.text())

    def pose(self):
        v = self.numbers("d", 7)
        return SimpleNamespace(position=SimpleNamespace(x=v[0], y=v[1], z=v[2]), orientation=SimpleNamespace(x=v[3], y=v[4], z=v[5], w=v[6]))


def image(c):
    m = SimpleNamespace(header=c.header(), height=c.number("I"), width=c.number("I"), encoding=c.text())
    m.is_bigendian, m.step, m.data = c.number("B"), c.number("I"), c.bytes()
    return m


def compressed_image(c):
    return SimpleNamespace(header=c.header(), format=c.text(), data=c.bytes())


def camera_info(c):
    m = SimpleNamespace(header=c.header(), height=c.number("I"), width=c.number("I"), distortion_model=c.text())
    m.D = c.numbers("d", c.number("I"))
    m.K = c.numbers("d", 9)
    return m


def posed(c):
    return SimpleNamespace(header=c.header(), pose=c.pose())


def posed_child(c):
    header = c.header()
    c.text()  # the name of the frame that moves
    return SimpleNamespace(header=header, pose=c.pose())


READERS = {"sensor_msgs/Image": image, "sensor_msgs/CompressedImage": compressed_image, "sensor_msgs/CameraInfo": camera_info,
           "geometry_msgs/PoseStamped": posed, "geometry_msgs/PoseWithCovarianceStamped": posed,
           "geometry_msgs/TransformStamped": posed_child, "nav_msgs/Odometry": posed_child}


def one_type(name):
    """The name of a type as in ROS 1."""
    return name.replace("/msg/", "/")


def unpacked(compression, data):
    module, package = {"lz4": ("lz4.frame", "python3-lz4"), "zstd": ("zstandard", "python3-zstandard")}.get(compression, (None, None))
    if module is None:
        raise BagError(f"a chunk is compressed as '{compression}', expected lz4 or zstd")
    try:
        __import__(module)
    except ImportError:
        raise BagError(f"its chunks are compressed as {compression}, which needs {package}") from None
    library = sys.modules[module]
    return library.decompress(data) if compression == "lz4" else library.ZstdDecompressor().decompressobj().decompress(data)


class Mcap:
    """Messages of one .mcap file in its order, as (topic, type, bytes)."""

    def __init__(self, file):
        self.file, self.schemas, self.channels = file, {}, {}

    def messages(self):
        with open(self.file, "rb") as stream:
            if stream.read(len(MAGIC)) != MAGIC:
                raise BagError("is no .mcap file")
            while True:
                head = stream.read(9)
                if len(head) < 9:  # the end, or that of a recording that was cut off
                    return
                kind, size = struct.unpack("<BQ", head)
                if kind not in (SCHEMA, CHANNEL, MESSAGE, CHUNK):
                    stream.seek(size, 1)
                    continue
                content = stream.read(size)
                if len(content) < size:
                    return
                if kind != CHUNK:
                    yield from self.record(kind, content)
                    continue
                length = struct.unpack_from("<I", content, 28)[0]  # of the name of the compression
                compression = content[32:32 + length].decode()
                records = content[40 + length:]
                if compression:
                    records = unpacked(compression, records)
                at = 0
                while at + 9 <= len(records):
                    kind, size = struct.unpack_from("<BQ", records, at)
                    yield from self.record(kind, records[at + 9:at + 9 + size])
                    at += 9 + size

    def record(self, kind, content):
        def text(at):
            size = struct.unpack_from("<I", content, at)[0]
            return content[at + 4:at + 4 + size].decode("utf-8", "replace"), at + 4 + size

        if kind == SCHEMA:
            self.schemas[struct.unpack_from("<H", content)[0]] = one_type(text(2)[0])
        elif kind == CHANNEL:
            channel, schema = struct.unpack_from("<HH", content)
            topic, at = text(4)
            self.channels[channel] = (topic, self.schemas.get(schema, ""), text(at)[0])
        elif kind == MESSAGE:
            topic, name, encoding = self.channels[struct.unpack_from("<H", content)[0]]
            if encoding == "cdr":  # messages of others, e.g. of ROS 1 or JSON, are none of ROS 2
                yield topic, name, content[22:]


class Database:
    """The same of a .db3 file."""

    def __init__(self, file):
        self.file = file

    def messages(self):
        with open(self.file, "rb") as stream:
            if stream.read(15) != b"SQLite format 3":
                raise BagError("is no .db3 file")
        connection = sqlite3.connect(f"{pathlib.Path(self.file).absolute().as_uri()}?mode=ro", uri=True)
        try:
            topics = {i: (name, one_type(kind)) for i, name, kind in connection.execute("SELECT id, name, type FROM topics")}
            for topic, data in connection.execute("SELECT topic_id, data FROM messages ORDER BY timestamp"):
                yield *topics[topic], data
        finally:
            connection.close()


class Bag:
    def __init__(self, path):
        path = pathlib.Path(path)
        files = [path]
        if path.is_dir():
            number = lambda f: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", f.name)]
            files = sorted((f for f in path.iterdir() if f.suffix in (".mcap", ".db3")), key=number)
            if not files:
                raise BagError("holds neither a .mcap nor a .db3 file")
        self.files = [Mcap(f) if f.suffix == ".mcap" else Database(f) for f in files]
        counts = collections.Counter((topic, kind) for topic, kind, _ in self.raw())
        self.topics = {topic: SimpleNamespace(msg_type=kind, message_count=n) for (topic, kind), n in counts.items()}

    def raw(self):
        for file in self.files:
            try:
                yield from file.messages()
            except (struct.error, sqlite3.Error, KeyError, ValueError, RuntimeError) as e:
                raise BagError(f"{file.file}: is damaged: {e}") from e

    def read_messages(self, topics):
        for topic, kind, data in self.raw():
            if topic not in topics:
                continue
            try:
                yield topic, READERS[kind](Cdr(data)), None
            except struct.error:
                raise BagError(f"{topic}: a message ends in the middle of its data") from None
