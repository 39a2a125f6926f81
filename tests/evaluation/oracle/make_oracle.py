#!/usr/bin/env python3
"""Writes two small trajectories and their errors, computed here by another route than in the library.

Alignment: the rotation is the polar factor of the cross-covariance, by Newton's iteration (the library: Horn's quaternion).
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


def ate(truth, estimate):
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
    H = [[sum((b[r] - mq[r]) * (a[c] - mp[c]) for a, b in zip(p, q)) for c in range(3)] for r in range(3)]
    for _ in range(100):
        T = transposed(inverse(H))
        H = [[0.5 * (H[r][c] + T[r][c]) for c in range(3)] for r in range(3)]
    e = [math.dist([a + b - c for a, b, c in zip(apply(H, v), mq, apply(H, mp))], w) for v, w in zip(p, q)]
    return n, math.sqrt(sum(x * x for x in e) / n), sum(e) / n, max(e)


def rpe(truth, estimate, delta):
    nearest = lambda poses, t: min(range(len(poses)), key=lambda k: abs(poses[k][0] - t))
    gaps = sorted(b[0] - a[0] for a, b in zip(truth, truth[1:]))
    m = len(gaps) // 2
    limit = 2 * (gaps[m] if len(gaps) % 2 else 0.5 * (gaps[m - 1] + gaps[m]))
    trans, rot = [], []
    for i, a in enumerate(estimate):
        j = nearest(estimate, a[0] + delta)
        if j == len(estimate) - 1:
            continue
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
    print("ATE pairs %d rmse %.12f mean %.12f max %.12f" % ate(truth, estimate))
    print("RPE 1 s pairs %d translation %.12f rotation_deg %.12f" % rpe(truth, estimate, 1.0))
