#!/usr/bin/env python3
"""A recording goes into bags of ROS 2, .mcap and .db3, and comes back as it was, apso_track follows it, and what is wrong is named.
Exits with 77 where python3-pil is not installed. usage: ros2_bag_to_tum.py CONVERTER PROGRAMS SCRATCH"""
import array
import pathlib
import shutil
import sqlite3
import struct
import subprocess
import sys

try:
    from PIL import Image as Picture
except ImportError:
    print("skipped: PIL is not installed")
    sys.exit(77)

converter, programs, scratch = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
shutil.rmtree(scratch, ignore_errors=True)
scratch.mkdir(parents=True)
room = scratch / "room"
FRAMES = 6
subprocess.run([programs / "apso_synth", "static_xyz", "--seed", "105", "--frames", str(FRAMES), "--quiet", "--output", room], check=True)


def run(*arguments):
    return subprocess.run([sys.executable, converter, *map(str, arguments)], capture_output=True, text=True)


# ------------------------------------------------------------------------------------------ messages, as rclcpp serialises them

class Message:
    """https://www.omg.org/spec/DDSI-RTPS, chapter 10: each number lies at a multiple of its size behind the first four bytes."""

    def __init__(self, big_endian):
        self.order, self.body = ">" if big_endian else "<", bytearray()

    def put(self, kind, *values):
        size = struct.calcsize("=" + kind)
        while len(self.body) % size:
            self.body += b"\0"
        self.body += struct.pack(self.order + str(len(values)) + kind, *values)
        return self

    def text(self, s):
        self.put("I", len(s) + 1)
        self.body += s.encode() + b"\0"
        return self

    def array(self, data):
        self.put("I", len(data))
        self.body += data
        return self

    def header(self, stamp, frame="camera"):
        seconds, _, fraction = stamp.partition(".")
        return self.put("i", int(seconds)).put("I", int(fraction.ljust(9, "0"))).text(frame)

    def bytes(self):
        return (b"\0\0" if self.order == ">" else b"\0\1") + b"\0\0" + bytes(self.body)


def image(stamp, encoding, size, data, bytes_per_pixel, gap, big_endian):
    row = size[0] * bytes_per_pixel
    padded = b"".join(data[y * row:(y + 1) * row] + gap * b"\x55" for y in range(size[1]))
    m = Message(big_endian).header(stamp).put("I", size[1], size[0]).text(encoding).put("B", 0).put("I", row + gap)
    return m.array(padded).bytes()


calibration = dict(line.split(": ") for line in (room / "camera.yaml").read_text().splitlines())
K = [float(calibration["fx"]), 0, float(calibration["cx"]), 0, float(calibration["fy"]), float(calibration["cy"]), 0, 0, 1]
stamps = [line.split()[0] for line in (room / "rgb.txt").read_text().splitlines()]
truth = [line.split() for line in (room / "groundtruth.txt").read_text().splitlines() if not line.startswith("#")]
TOPICS = {"/camera/color/image_raw": "sensor_msgs/msg/Image", "/camera/color/image_raw/compressed": "sensor_msgs/msg/CompressedImage",
          "/camera/depth/image_raw": "sensor_msgs/msg/Image", "/camera/color/camera_info": "sensor_msgs/msg/CameraInfo",
          "/vicon/pose": "geometry_msgs/msg/PoseStamped", "/vicon/transform": "geometry_msgs/msg/TransformStamped",
          "/odom": "nav_msgs/msg/Odometry", "/chatter": "std_msgs/msg/String"}
messages = []  # (topic, seconds, bytes)
for k, stamp in enumerate(stamps):
    rgb = Picture.open(room / f"rgb/{stamp}.png").convert("RGB")
    raw = Picture.open(room / f"depth/{stamp}.png")
    units = raw.tobytes() if raw.mode.startswith("I;16") else b"".join(v.to_bytes(2, "little") for v in raw.getdata())
    metres = array.array("f", (v / 5000 if v else float("nan") for v in memoryview(units).cast("H"))).tobytes()
    big = k % 2 == 1
    for topic, content in [
            ("/camera/color/image_raw", image(stamp, "bgr8" if big else "rgb8", rgb.size, rgb.tobytes("raw", "BGR" if big else "RGB"), 3, 5, big)),
            ("/camera/color/image_raw/compressed",
             Message(big).header(stamp).text("rgb8; png compressed bgr8").array((room / f"rgb/{stamp}.png").read_bytes()).bytes()),
            ("/camera/depth/image_raw", image(stamp, "32FC1", rgb.size, metres, 4, 0, big)),
            ("/camera/color/camera_info",
             Message(big).header(stamp).put("I", rgb.size[1], rgb.size[0]).text("plumb_bob").put("I", 5).put("d", *(5 * [0.0])).put("d", *K).bytes()),
            ("/chatter", Message(big).text("hello").bytes())]:
        messages.append((topic, float(stamp), content))
for k, (stamp, *values) in enumerate(truth):
    v = [float(x) for x in values]
    big = k % 2 == 1
    messages.append(("/vicon/pose", float(stamp), Message(big).header(stamp, "world").put("d", *v).bytes()))
    messages.append(("/vicon/transform", float(stamp), Message(big).header(stamp, "world").text("helmet").put("d", *v).bytes()))
    messages.append(("/odom", float(stamp), Message(big).header(stamp, "world").text("base").put("d", *v, *(36 * [0.0])).put("d", *(42 * [0.0])).bytes()))
messages.sort(key=lambda m: m[1])

# ------------------------------------------------------------------------------------------ bags


def text(s):
    return struct.pack("<I", len(s)) + s.encode()


def record(kind, content):
    return struct.pack("<BQ", kind, len(content)) + content


def mcap(compression, pack, one_chunk_each):
    """https://mcap.dev/spec: header, schemas and channels, chunks with an index of a kind that readers may leave out, end, footer."""
    magic = b"\x89MCAP0\r\n"
    out = magic + record(1, text("ros2") + text("test"))
    described = b""
    for i, (topic, kind) in enumerate(TOPICS.items()):
        described += record(3, struct.pack("<H", i + 1) + text(kind) + text("ros2msg") + text("# fields"))
        described += record(4, struct.pack("<HH", i, i + 1) + text(topic) + text("cdr") + struct.pack("<I", 0))
    names = list(TOPICS)
    chunks = [described]
    for n, (topic, seconds, content) in enumerate(messages):
        t = int(seconds * 1e9)
        one = record(5, struct.pack("<HIQQ", names.index(topic), n, t, t) + content)
        chunks = chunks + [one] if n % one_chunk_each == 0 else chunks[:-1] + [chunks[-1] + one]
    for chunk in chunks:
        if compression is None:  # no chunks at all
            out += chunk
            continue
        packed = pack(chunk)
        out += record(6, struct.pack("<QQQI", 0, 0, len(chunk), 0) + text(compression) + struct.pack("<Q", len(packed)) + packed)
        out += record(7, struct.pack("<HI", 0, 0))
    return out + record(15, struct.pack("<I", 0)) + record(2, struct.pack("<QQI", 0, 0, 0)) + magic


problems = []


def check(what, ok, more=""):
    if not ok:
        problems.append(f"{what}: {more}")


def check_same(name, folder, pictures=True):
    for file in ("rgb.txt", "depth.txt", "groundtruth.txt"):
        old = [line.split() for line in (room / file).read_text().splitlines() if not line.startswith("#")]
        new = [line.split() for line in (folder / file).read_text().splitlines()]
        same = len(old) == len(new) > 0 and all(abs(float(a[0]) - float(b[0])) < 1e-6 for a, b in zip(old, new))
        if file == "groundtruth.txt":
            same = same and all(abs(float(x) - float(y)) < 1e-6 for a, b in zip(old, new) for x, y in zip(a, b))
        check(f"{name} {file}", same, f"{old[:1]} became {new[:1]}")
    for stamp in stamps if pictures else stamps[:1]:
        for kind in ("rgb", "depth"):
            a, b = (list(Picture.open(f / kind / f"{stamp}.png").getdata()) for f in (room, folder))
            check(f"{name} {kind}/{stamp}.png", a == b, "differs")


kinds = {"plain": (None, None), "chunks": ("", bytes)}
for module, name in (("lz4.frame", "lz4"), ("zstandard", "zstd")):
    try:
        library = getattr(__import__(module), "frame", sys.modules[module])
        kinds[name] = (name, library.compress if name == "lz4" else library.ZstdCompressor().compress)
    except ImportError:
        print(f"not tested: chunks compressed as {name}, {module} is not installed")
topics = ("--colour", "/camera/color/image_raw", "--depth", "/camera/depth/image_raw")
for name, (compression, pack) in kinds.items():
    file = scratch / f"{name}.mcap"
    file.write_bytes(mcap(compression, pack, 7))
    o = run(file, "--output", scratch / name, *topics, "--info", "/camera/color/camera_info", "--truth", "/vicon/pose")
    check(f"{name}.mcap", o.returncode == 0, o.stdout + o.stderr)
    if o.returncode == 0:
        check_same(name, scratch / name, pictures=name == "chunks")

bag = scratch / "bag"  # as ros2 bag record -s sqlite3 makes it: a folder, here with two files
bag.mkdir()
(bag / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
half = len(messages) // 2
for n, part in ((9, messages[:half]), (10, messages[half:])):
    with sqlite3.connect(bag / f"bag_{n}.db3") as db:
        db.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT)")
        db.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
        ids = {topic: i + 1 for i, topic in enumerate(reversed(TOPICS))}
        db.executemany("INSERT INTO topics VALUES(?, ?, ?, 'cdr', '')", [(i, topic, TOPICS[topic]) for topic, i in ids.items()])
        db.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", [(ids[t], int(s * 1e9), c) for t, s, c in part])
o = run(bag, "--list")
check("topics are listed", f"/camera/color/image_raw  sensor_msgs/Image  {FRAMES} messages" in o.stdout, o.stdout + o.stderr)
for name, colour, pose in (("first", "/camera/color/image_raw", "/vicon/transform"), ("second", "/camera/color/image_raw/compressed", "/odom")):
    o = run(bag, "--output", scratch / name, "--colour", colour, "--depth", topics[3], "--info", "/camera/color/camera_info", "--truth", pose)
    check(f"{name} of .db3", o.returncode == 0, o.stdout + o.stderr)
    if o.returncode == 0:
        check_same(name, scratch / name, pictures=False)
o = subprocess.run([programs / "apso_track", scratch / "chunks", "--camera", scratch / "chunks/camera.yaml", "--quiet", "--output", scratch / "run"],
                   capture_output=True, text=True)
check("apso_track follows it", o.returncode == 0 and f"over {FRAMES} pairs" in o.stdout, o.stdout + o.stderr)

# a recording that was cut off gives what is in it; what is damaged is named
whole = (scratch / "chunks.mcap").read_bytes()
(scratch / "cut.mcap").write_bytes(whole[:len(whole) // 2])
o = run(scratch / "cut.mcap", "--list")
check("a file that was cut off", o.returncode == 0 and "/camera/color/image_raw  sensor_msgs/Image" in o.stdout, o.stdout + o.stderr)
(scratch / "unknown.mcap").write_bytes(mcap("brotli", bytes, 7))
(scratch / "noise.mcap").write_bytes(whole[:8] + record(5, b"\xff" * 40))
(scratch / "none.mcap").write_bytes(b"no bag")
(scratch / "none.db3").write_bytes(b"no bag")
(scratch / "empty").mkdir()
short = messages[0][2][:len(messages[0][2]) // 2]
messages = [(messages[0][0], messages[0][1], short)] + messages[1:]
(scratch / "short.mcap").write_bytes(mcap(None, None, 7))
for arguments, words in [((scratch / "unknown.mcap", "--list"), "is compressed as 'brotli', expected lz4 or zstd"),
                         ((scratch / "noise.mcap", "--list"), "is damaged"),
                         ((scratch / "none.mcap", "--list"), "cannot be read as a bag of ROS 2: is no .mcap file"),
                         ((scratch / "none.db3", "--list"), "is no .db3 file"),
                         ((scratch / "empty", "--list"), "holds neither a .mcap nor a .db3 file"),
                         ((scratch / "short.mcap", "--output", scratch / "x", *topics), "a message ends in the middle of its data"),
                         ((bag, "--output", scratch / "y", "--colour", "/chatter", "--depth", topics[3]), "--colour /chatter: is std_msgs/String")]:
    o = run(*arguments)
    check(words, o.returncode == 1 and words in o.stderr and "Traceback" not in o.stderr, f"{o.returncode}: {o.stdout}{o.stderr}")
sys.exit("\n".join(problems) or 0)
