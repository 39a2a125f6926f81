#!/usr/bin/env python3
"""Turns a bag of ROS 1 or ROS 2 with RGB-D images into a folder in TUM format, which apso_track reads.

    scripts/bag_to_tum.py run.bag --list
    scripts/bag_to_tum.py run.bag --output run --colour /camera/rgb/image_color --depth /camera/depth_registered/image \\
        --info /camera/rgb/camera_info --truth /vicon/pose

Writes rgb/, depth/ (16 bit), rgb.txt, depth.txt; camera.yaml from the camera info; groundtruth.txt from poses, transforms or odometry.
The stamps are those of the message headers. Depth has to be registered to the colour image, as it is in *_registered topics.
Needs python3-pil, and for a .bag python3-rosbag, python3-sensor-msgs and python3-geometry-msgs. A .mcap or .db3, or the folder that holds
them, needs no ROS; where its chunks are compressed python3-lz4 or python3-zstandard.
"""
import argparse
import io
import os
import pathlib
import sys

import ros2_bag

try:
    from PIL import Image
except ImportError:
    sys.exit("bag_to_tum.py: PIL is missing; apt-get install python3-pil")

IMAGES = ("sensor_msgs/Image", "sensor_msgs/CompressedImage")
POSES = ("geometry_msgs/PoseStamped", "geometry_msgs/PoseWithCovarianceStamped", "geometry_msgs/TransformStamped", "nav_msgs/Odometry")
PER_METRE = {"16UC1": 1000, "mono16": 1000}  # REP 118: integers are millimetres; 32FC1 is metres


def fail(text):
    sys.exit(f"bag_to_tum.py: {text}")


def rows(message, bytes_per_pixel):
    """The pixels without what a row is filled up with, the first byte of a number first."""
    width = message.width * bytes_per_pixel
    if message.step < width or len(message.data) < message.step * message.height:
        fail(f"an image says {message.width}x{message.height} with {message.step} bytes per row, but has {len(message.data)} bytes")
    return b"".join(message.data[y * message.step:y * message.step + width] for y in range(message.height))


def colour(message):
    if hasattr(message, "format"):  # compressed: JPEG or PNG
        return Image.open(io.BytesIO(message.data)).convert("RGB")
    size = (message.width, message.height)
    if message.encoding in ("rgb8", "8UC3"):
        return Image.frombytes("RGB", size, rows(message, 3))
    if message.encoding == "bgr8":
        return Image.frombytes("RGB", size, rows(message, 3), "raw", "BGR")
    if message.encoding in ("rgba8", "bgra8"):
        return Image.frombytes("RGB", size, rows(message, 4), "raw", "RGBX" if message.encoding == "rgba8" else "BGRX")
    if message.encoding in ("mono8", "8UC1"):
        return Image.frombytes("L", size, rows(message, 1))
    return fail(f"colour images are {message.encoding}, expected rgb8, bgr8, rgba8, bgra8 or mono8")


def depth(message):
    """16-bit image, and its units per metre."""
    if hasattr(message, "format"):
        if "compressedDepth" not in message.format:
            fail(f"depth images are compressed as '{message.format}', expected 16UC1 compressedDepth, which loses nothing")
        if "32FC1" in message.format:
            fail("compressed depth is 32FC1, expected 16UC1")
        return Image.open(io.BytesIO(message.data[12:])), 1000  # after the header of the image transport
    size = (message.width, message.height)
    if message.encoding in PER_METRE:
        return Image.frombytes("I;16", size, rows(message, 2), "raw", "I;16B" if message.is_bigendian else "I;16"), PER_METRE[message.encoding]
    if message.encoding == "32FC1":
        metres = memoryview(rows(message, 4)).cast("f")
        if message.is_bigendian != (sys.byteorder == "big"):
            fail("depth is 32FC1 of the other byte order")
        units = bytearray()
        for z in metres:  # NaN and what does not fit are no depth
            units += (round(5000 * z) if 0 < z < 13.1 else 0).to_bytes(2, "little")
        return Image.frombytes("I;16", size, bytes(units)), 5000
    return fail(f"depth images are {message.encoding}, expected 16UC1 or 32FC1")


def pose_of(message):
    for name in ("pose", "transform"):
        while hasattr(message, name):
            message = getattr(message, name)
    t = message.translation if hasattr(message, "translation") else message.position
    q = message.rotation if hasattr(message, "rotation") else message.orientation
    return t.x, t.y, t.z, q.x, q.y, q.z, q.w


def stamp(message):
    return f"{message.header.stamp.secs}.{message.header.stamp.nsecs // 1000:06d}"


def topic_of(kind, given, topics, types, words):
    """The topic that was asked for, or the only one that fits."""
    fitting = [t for t, info in topics.items() if info.msg_type in types]
    if given is None:
        named = [t for t in fitting if any(w in t for w in words)]
        if len(named) == 1:
            return named[0]
        fail(f"--{kind} is needed, one of: {', '.join(sorted(fitting)) or 'none, the bag has no such topic'}")
    if given not in topics:
        fail(f"--{kind} {given}: the bag has no such topic; it has: {', '.join(sorted(topics))}")
    if given not in fitting:
        fail(f"--{kind} {given}: is {topics[given].msg_type}, expected {' or '.join(types)}")
    return given


class Ros1Bag:
    def __init__(self, path):
        try:
            import rosbag
        except ImportError as e:
            fail(f"{e.name} is missing; apt-get install python3-rosbag python3-sensor-msgs python3-geometry-msgs")
        try:
            bag = rosbag.Bag(path)
        except (OSError, rosbag.ROSBagException) as e:
            fail(f"{path}: cannot be read as a bag of ROS 1: {e}")
        self.topics = bag.get_type_and_topic_info().topics
        self.read_messages = bag.read_messages


def opened(path):
    if os.path.isdir(path) or path.endswith((".mcap", ".db3")):
        try:
            return ros2_bag.Bag(path)
        except (OSError, ros2_bag.BagError) as e:
            fail(f"{path}: cannot be read as a bag of ROS 2: {e}")
    return Ros1Bag(path)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("bag", help="a .bag of ROS 1; a .mcap or .db3 of ROS 2, or the folder with them")
    p.add_argument("--list", action="store_true", help="print the topics and stop")
    p.add_argument("--output", help="folder to make; one that is there is refused")
    p.add_argument("--colour", help="topic of the colour images (default: the only one with rgb or color in its name)")
    p.add_argument("--depth", help="topic of the depth images (default: the only one with depth in its name)")
    p.add_argument("--info", help="topic of the camera info of the colour camera, for camera.yaml")
    p.add_argument("--truth", help="topic of poses, transforms or odometry, for groundtruth.txt")
    a = p.parse_args()
    bag = opened(a.bag)
    topics = bag.topics
    if a.list:
        for name, info in sorted(topics.items()):
            print(f"{name}  {info.msg_type}  {info.message_count} messages")
        return
    if not a.output:
        p.error("--output is needed")
    names = {topic_of("colour", a.colour, topics, IMAGES, ("rgb", "color", "colour")): "rgb",
             topic_of("depth", a.depth, topics, IMAGES, ("depth",)): "depth"}
    if len(names) < 2:
        fail("--colour and --depth are the same topic")
    if a.info:
        names[topic_of("info", a.info, topics, ("sensor_msgs/CameraInfo",), ())] = "info"
    if a.truth:
        names[topic_of("truth", a.truth, topics, POSES, ())] = "truth"
    out = pathlib.Path(a.output)
    try:
        out.mkdir(parents=True)
    except FileExistsError:
        fail(f"{out}: is there already; take another folder")
    lists = {"rgb": [], "depth": [], "truth": []}
    info = units = None
    for folder in ("rgb", "depth"):
        (out / folder).mkdir()
    for topic, message, _ in bag.read_messages(topics=list(names)):
        kind = names[topic]
        if kind == "info":
            info = info or message
            continue
        if kind == "truth":
            lists[kind].append(f"{stamp(message)} " + " ".join(f"{v:.9g}" for v in pose_of(message)))
            continue
        image = colour(message) if kind == "rgb" else None
        if kind == "depth":
            image, units = depth(message)
        file = f"{kind}/{stamp(message)}.png"
        image.save(out / file, compress_level=1)
        lists[kind].append(f"{stamp(message)} {file}")
    for name, file in (("rgb", "rgb.txt"), ("depth", "depth.txt"), ("truth", "groundtruth.txt")):
        if name != "truth" or a.truth:
            (out / file).write_text("".join(line + "\n" for line in sorted(lists[name], key=lambda line: float(line.split()[0]))))
    if info:
        d = (list(info.D) + 5 * [0.0])[:5]
        text = (f"name: {out.name}\nfx: {info.K[0]}\nfy: {info.K[4]}\ncx: {info.K[2]}\ncy: {info.K[5]}\nwidth: {info.width}\nheight: {info.height}\n"
                f"depth_scale: {units}\n")
        if any(d):
            if info.distortion_model not in ("plumb_bob", ""):
                fail(f"{a.info}: its distortion is {info.distortion_model}, expected plumb_bob; take rectified images")
            text += "".join(f"{k}: {v}\n" for k, v in zip(("k1", "k2", "p1", "p2", "k3"), d))
        (out / "camera.yaml").write_text(text)
    print(f"{len(lists['rgb'])} colour and {len(lists['depth'])} depth images in {out}, {units} units of depth per metre")
    print(f"track them: apso_track {out} --camera {out / 'camera.yaml' if info else 'CAMERA.yaml'} --output DIR")


if __name__ == "__main__":
    try:
        main()
    except ros2_bag.BagError as e:
        fail(e)
