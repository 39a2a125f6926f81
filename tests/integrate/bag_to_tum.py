#!/usr/bin/env python3
"""A recording goes into a bag of ROS 1 and comes back as it was, apso_track follows it, and what is wrong is named.
Exits with 77 where python3-rosbag is not installed. usage: bag_to_tum.py CONVERTER PROGRAMS SCRATCH"""
import array
import pathlib
import shutil
import subprocess
import sys

try:
    import genpy
    import rosbag
    from geometry_msgs.msg import PoseStamped
    from PIL import Image as Picture
    from sensor_msgs.msg import CameraInfo, CompressedImage, Image
except ImportError as e:
    print(f"skipped: {e.name} is not installed")
    sys.exit(77)

converter, programs, scratch = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
shutil.rmtree(scratch, ignore_errors=True)
scratch.mkdir(parents=True)
room = scratch / "room"
FRAMES = 6
subprocess.run([programs / "apso_synth", "static_xyz", "--seed", "105", "--frames", str(FRAMES), "--quiet", "--output", room], check=True)


def run(*arguments):
    return subprocess.run([sys.executable, converter, *map(str, arguments)], capture_output=True, text=True)


def filled(message, stamp):
    seconds, _, fraction = stamp.partition(".")
    message.header.stamp = genpy.Time(int(seconds), int(fraction.ljust(9, "0")))
    return message


def image(stamp, encoding, size, data, bytes_per_pixel, gap=0):
    m = filled(Image(), stamp)
    m.width, m.height, m.encoding = size[0], size[1], encoding
    row = size[0] * bytes_per_pixel
    m.step = row + gap
    m.data = b"".join(data[y * row:(y + 1) * row] + gap * b"\x55" for y in range(size[1]))
    return m


def camera():
    values = dict(line.split(": ") for line in (room / "camera.yaml").read_text().splitlines())
    m = CameraInfo()
    m.width, m.height, m.distortion_model, m.D = int(values["width"]), int(values["height"]), "plumb_bob", 5 * [0.0]
    m.K = [float(values["fx"]), 0, float(values["cx"]), 0, float(values["fy"]), float(values["cy"]), 0, 0, 1]
    return m


stamps = [line.split()[0] for line in (room / "rgb.txt").read_text().splitlines()]
with rosbag.Bag(str(scratch / "room.bag"), "w", compression="lz4") as bag:
    for k, stamp in enumerate(stamps):
        rgb = Picture.open(room / f"rgb/{stamp}.png").convert("RGB")
        raw = Picture.open(room / f"depth/{stamp}.png")
        units = raw.tobytes() if raw.mode.startswith("I;16") else b"".join(v.to_bytes(2, "little") for v in raw.getdata())
        metres = memoryview(units).cast("H")
        m = image(stamp, "bgr8" if k % 2 else "rgb8", rgb.size, rgb.tobytes("raw", "BGR" if k % 2 else "RGB"), 3, gap=5)
        bag.write("/camera/rgb/image_color", m, m.header.stamp)
        bag.write("/camera/depth_registered/image",
                  image(stamp, "32FC1", rgb.size, array.array("f", (v / 5000 if v else float("nan") for v in metres)).tobytes(), 4), m.header.stamp)
        bag.write("/camera/depth_registered/millimetres",
                  image(stamp, "16UC1", rgb.size, array.array("H", (v // 5 for v in metres)).tobytes(), 2), m.header.stamp)
        c = filled(CompressedImage(), stamp)
        c.format = "rgb8; png compressed bgr8"
        c.data = (room / f"rgb/{stamp}.png").read_bytes()
        bag.write("/camera/rgb/image_color/compressed", c, m.header.stamp)
        bag.write("/camera/rgb/camera_info", camera(), m.header.stamp)
    for line in [l for l in (room / "groundtruth.txt").read_text().splitlines() if not l.startswith("#")]:
        f = line.split()
        p = filled(PoseStamped(), f[0])
        for name, value in zip("xyz", f[1:4]):
            setattr(p.pose.position, name, float(value))
        for name, value in zip("xyzw", f[4:8]):
            setattr(p.pose.orientation, name, float(value))
        bag.write("/vicon/pose", p, p.header.stamp)

problems = []


def check(what, ok, more=""):
    if not ok:
        problems.append(f"{what}: {more}")


o = run(scratch / "room.bag", "--list")
check("topics are listed", f"/camera/rgb/image_color  sensor_msgs/Image  {FRAMES} messages" in o.stdout, o.stdout + o.stderr)
o = run(scratch / "room.bag", "--output", scratch / "back", "--colour", "/camera/rgb/image_color", "--depth", "/camera/depth_registered/image",
        "--info", "/camera/rgb/camera_info", "--truth", "/vicon/pose")
check("conversion", o.returncode == 0, o.stderr)
for name in ("rgb.txt", "depth.txt", "groundtruth.txt"):
    old = [line.split() for line in (room / name).read_text().splitlines() if not line.startswith("#")]
    new = [line.split() for line in (scratch / "back" / name).read_text().splitlines()]
    same = len(old) == len(new) and all(abs(float(a[0]) - float(b[0])) < 1e-6 for a, b in zip(old, new))
    if name == "groundtruth.txt":
        same = same and all(abs(float(x) - float(y)) < 1e-6 for a, b in zip(old, new) for x, y in zip(a, b))
    check(name, same, f"{old[:1]} became {new[:1]}")
for stamp in stamps:
    for folder in ("rgb", "depth"):
        a, b = (list(Picture.open(f / folder / f"{stamp}.png").getdata()) for f in (room, scratch / "back"))
        check(f"{folder}/{stamp}.png", a == b, "differs")
o = subprocess.run([programs / "apso_track", scratch / "back", "--camera", scratch / "back/camera.yaml", "--quiet", "--output", scratch / "run"],
                   capture_output=True, text=True)
check("apso_track follows it", o.returncode == 0 and f"over {FRAMES} pairs" in o.stdout, o.stdout + o.stderr)

o = run(scratch / "room.bag", "--output", scratch / "small", "--colour", "/camera/rgb/image_color/compressed", "--depth",
        "/camera/depth_registered/millimetres")
check("compressed colour, millimetres", o.returncode == 0 and "1000 units" in o.stdout, o.stdout + o.stderr)
a, b = (list(Picture.open(f / "depth" / f"{stamps[0]}.png").getdata()) for f in (room, scratch / "small"))
check("millimetres", all(x // 5 == y for x, y in zip(a, b)), "differ")

for arguments, words in [((scratch / "room.bag", "--output", scratch / "back"), "--colour is needed, one of:"),
                         ((scratch / "room.bag", "--output", scratch / "back", "--colour", "/camera/rgb/image_color", "--depth",
                           "/camera/depth_registered/image"), "is there already"),
                         ((scratch / "room.bag", "--output", scratch / "x", "--colour", "/nothing", "--depth", "/vicon/pose"),
                          "--colour /nothing: the bag has no such topic"),
                         ((room / "rgb.txt", "--list"), "cannot be read as a bag of ROS 1")]:
    o = run(*arguments)
    check(words, o.returncode == 1 and words in o.stderr, f"{o.returncode}: {o.stdout}{o.stderr}")
sys.exit("\n".join(problems) or 0)
