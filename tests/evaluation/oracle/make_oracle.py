#!/usr/bin/env python3
"""Writes small trajectories and their errors, computed here by another route than in the library.

Alignment: the rotation is the polar factor of the cross-covariance, by Newton's iteration (the library: Horn's quaternion); the scale
and the angle about gravity are found by a golden section search (the library: closed forms).
Association and pairs follow the description of the TUM RGB-D benchmark: greedy by smallest difference of time; pose nearest to
i + delta. Only the standard library of Python is needed.  usage: make_oracle.py  (writes next to itself)
"""
import math
import pathlib

HERE = pathlib.Path(__file__).parent


def mul(A, B):
    return [[sum(A[i][k] * B[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def apply(A, v):
    return [sum(A[i][k] * v[k] for k in range(3)) for i in range(3)]


def transposed(A):
    return [list(r) for r in zip(*A)]


def inverse(A):
    (a, b, c), (d, e, f), (g, h, i) = A
    det = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    return [[(e * i - f * h) / det, (c * h - b * i) / det, (b * f - c * e) / det],
            [(f * g - d * i) / det, (a * i - c * g) / det, (c * d - a * f) / det],
            [(d * h - e * g) / det, (b * g - a * h) / det, (a * e - b * d) / det]]


def rotation(q):
    x, y, z, w = q
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]


def turned(axis, angle):
    n = math.sqrt(sum(a * a for a in axis))
    s = math.sin(angle / 2) / n
    return [axis[0] * s, axis[1] * s, axis[2] * s, math.cos(angle / 2)]


def line(t, p, q):
    return "%.4f " % t + " ".join("%.6f" % v for v in p) + " " + " ".join("%.6f" % v for v in q)


def read(path):
    out = []
    for text in path.read_text().splitlines():
        if text.startswith("#"):
            continue
        v = [float(x) for x in text.split()]
        n = math.sqrt(sum(x * x for x in v[4:8]))
        out.append((v[0], v[1:4], rotation([x / n for x in v[4:8]])))
    return out


def write_trajectories():
    truth, estimate = ["# ground truth: stamp x y z qx qy qz qw"], ["# estimate, in a world of its own"]
    for i in range(160):
        t = 0.0333 * i
        p = [math.cos(0.6 * t), 0.7 * math.sin(0.9 * t), 0.2 * t + 0.1 * math.sin(3 * t)]
        truth.append(line(t, p, turned([0.3, 1, 0.2], 0.5 * math.sin(0.4 * t) + 0.1 * t)))
        if i % 2 == 0 and i not in (40, 42, 44):
            e = [p[0] + 0.02 * math.sin(2.3 * t), p[1] - 0.015 * math.cos(1.7 * t), p[2] + 0.01 * t]
            W = rotation(turned([1, -2, 0.5], 0.8))
            q = turned([0.3, 1, 0.2], 0.5 * math.sin(0.4 * t) + 0.1 * t + 0.01 * math.sin(t))
            R = mul(W, rotation(q))
            w = math.sqrt(max(0.0, 1 + R[0][0] + R[1][1] + R[2][2])) / 2
            q = [(R[2][1] - R[1][2]) / (4 * w), (R[0][2] - R[2][0]) / (4 * w), (R[1][0] - R[0][1]) / (4 * w), w]
            estimate.append(line(t + 0.004 * math.sin(11 * i), [a + b for a, b in zip(apply(W, e), [2, -1, 0.5])], q))
    (HERE / "truth.txt").write_text("\n".join(truth) + "\n")
    (HERE / "estimate.txt").write_text("\n".join(estimate) + "\n")


def write_other_formats(truth, estimate):
    """The same poses for EuRoC (nanoseconds, w first) and as ORB-SLAM3 writes them; every second one for KITTI, with a scale."""
    rows = lambda name: [x.split() for x in (HERE / name).read_text().splitlines() if not x.startswith("#")]
    ns = lambda t: str(1500000000000000000 + round(float(t) * 10000) * 100000)
    euroc = ["#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w [],q_x [],q_y [],q_z [],v_x [m s^-1],v_y [m s^-1],v_z [m s^-1]"]
    euroc += [",".join([ns(r[0])] + r[1:4] + [r[7]] + r[4:7] + ["0.1", "0.2", "0.3"]) for r in rows("truth.txt")]
    (HERE / "truth_euroc.csv").write_text("\n".join(euroc) + "\n")
    (HERE / "estimate_ns.txt").write_text("".join(" ".join([ns(r[0])] + r[1:]) + "\n" for r in rows("estimate.txt")))
    matrix = lambda p, R: " ".join("%.9e" % v for k in range(3) for v in R[k] + [p[k]]) + "\n"
    (HERE / "truth_kitti.txt").write_text("".join(matrix(p, R) for _, p, R in truth[:2 * len(estimate):2]))
    (HERE / "estimate_kitti.txt").write_text("".join(matrix([0.8 * x for x in p], R) for _, p, R in estimate))


def read_kitti(path):
    out = []
    for i, text in enumerate(path.read_text().splitlines()):
        v = [float(x) for x in text.split()]
        out.append((float(i), v[3::4], [v[4 * k:4 * k + 3] for k in range(3)]))
    return out


def least(f, low, high):
    """Argument of the minimum of a function with one minimum in there."""
    g = (math.sqrt(5) - 1) / 2
    for _ in range(120):
        a, b = high - g * (high - low), low + g * (high - low)
        low, high = (low, b) if f(a) < f(b) else (a, high)
    return 0.5 * (low + high)


def ate(truth, estimate, kind="se3", axis=2):
    candidates = sorted((abs(a[0] - b[0]), i, j) for i, a in enumerate(truth) for j, b in enumerate(estimate) if abs(a[0] - b[0]) < 0.02)
    left, right, pairs = set(), set(), []
    for _, i, j in candidates:
        if i not in left and j not in right:
            left.add(i), right.add(j), pairs.append((i, j))
    n = len(pairs)
    q = [truth[i][1] for i, _ in pairs]
    p = [estimate[j][1] for _, j in pairs]
    mq = [sum(v[k] for v in q) / n for k in range(3)]
    mp = [sum(v[k] for v in p) / n for k in range(3)]
    q = [[a - b for a, b in zip(v, mq)] for v in q]
    p = [[a - b for a, b in zip(v, mp)] for v in p]
    errors = lambda R, s: [math.dist([s * x for x in apply(R, a)], b) for a, b in zip(p, q)]
    squares = lambda R, s: sum(x * x for x in errors(R, s))
    if kind == "yaw":
        about = lambda angle: rotation(turned([float(k == axis) for k in range(3)], angle))
        start = min((squares(about(0.01 * k), 1), 0.01 * k) for k in range(-315, 315))[1]
        H = about(least(lambda angle: squares(about(angle), 1), start - 0.02, start + 0.02))
    else:
        H = [[sum(b[r] * a[c] for a, b in zip(p, q)) for c in range(3)] for r in range(3)]
        for _ in range(100):
            T = transposed(inverse(H))
            H = [[0.5 * (H[r][c] + T[r][c]) for c in range(3)] for r in range(3)]
    scale = least(lambda s: squares(H, s), 0.01, 100) if kind == "sim3" else 1
    e = errors(H, scale)
    return n, math.sqrt(sum(x * x for x in e) / n), sum(e) / n, max(e), scale


def rpe(truth, estimate, delta, frames=False):
    nearest = lambda poses, t: min(range(len(poses)), key=lambda k: abs(poses[k][0] - t))
    gaps = sorted(b[0] - a[0] for a, b in zip(truth, truth[1:]))
    m = len(gaps) // 2
    limit = 2 * (gaps[m] if len(gaps) % 2 else 0.5 * (gaps[m - 1] + gaps[m]))
    trans, rot = [], []
    for i, a in enumerate(estimate):
        j = nearest(estimate, a[0] + delta)
        if j == len(estimate) - 1 and not (frames and j - i == delta):
            continue  # over frames all n - delta pairs, over time those that cannot be cut short
        g, h = nearest(truth, a[0]), nearest(truth, estimate[j][0])
        if abs(truth[g][0] - a[0]) > limit or abs(truth[h][0] - estimate[j][0]) > limit:
            continue
        motion = lambda u, v: (mul(transposed(u[2]), v[2]), apply(transposed(u[2]), [x - y for x, y in zip(v[1], u[1])]))
        (RA, tA), (RB, tB) = motion(a, estimate[j]), motion(truth[g], truth[h])
        R = mul(transposed(RB), RA)  # B^-1 A, as printed in Sturm et al.
        t = apply(transposed(RB), [x - y for x, y in zip(tA, tB)])
        trans.append(math.sqrt(sum(x * x for x in t)))
        s = [R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1]]
        rot.append(math.degrees(math.atan2(math.sqrt(sum(x * x for x in s)), R[0][0] + R[1][1] + R[2][2] - 1)))
    n = len(trans)
    return n, math.sqrt(sum(x * x for x in trans) / n), math.sqrt(sum(x * x for x in rot) / n)


if __name__ == "__main__":
    write_trajectories()
    truth, estimate = read(HERE / "truth.txt"), read(HERE / "estimate.txt")
    line_of = "ATE %s pairs %d rmse %.12f mean %.12f max %.12f scale %.9f"
    for kind in ("se3", "sim3", "yaw"):
        print(line_of % ((kind,) + ate(truth, estimate, kind)))
    print("RPE 1 s pairs %d translation %.12f rotation_deg %.12f" % rpe(truth, estimate, 1.0))
    write_other_formats(truth, estimate)
    truth, estimate = read_kitti(HERE / "truth_kitti.txt"), read_kitti(HERE / "estimate_kitti.txt")
    for kind, axis in (("se3", 2), ("sim3", 2), ("yaw", 1)):
        print("KITTI " + line_of % ((kind,) + ate(truth, estimate, kind, axis)))
    print("KITTI RPE 1 frame pairs %d translation %.12f rotation_deg %.12f" % rpe(truth, estimate, 1, frames=True))
