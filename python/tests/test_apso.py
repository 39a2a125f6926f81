"""Compares the Python module with the C++ library bit by bit, and checks its errors.

usage: APSO_REFERENCE=FOLDER python3 -m unittest test_apso   (FOLDER: written by apso_python_reference)
"""
import os
import pathlib
import sys
import threading
import time
import unittest

import numpy as np

import apso

FOLDER = pathlib.Path(os.environ["APSO_REFERENCE"])
UNIT = float(np.float32(1) / np.float32(5000))
FRAMES = 12


def load(name, dtype):
    return np.fromfile(FOLDER / name, dtype)


class Reference:
    """What the C++ program wrote."""

    def __init__(self):
        self.values = dict(line.split(" ", 1) for line in (FOLDER / "results.txt").read_text().splitlines())
        camera = load("camera.f64", np.float64)
        self.K = camera[:4]
        self.width, self.height = int(camera[4]), int(camera[5])
        self.shape = (self.height, self.width)

    def number(self, name):
        return float.fromhex(self.values[name])

    def matrix(self, name, n):
        return np.array([[self.number(f"{name}[{i},{j}]") for j in range(n)] for i in range(n)])

    def frame(self, i):
        return load(f"grey{i}.u8", np.uint8).reshape(self.shape), load(f"depth{i}.u16", np.uint16).reshape(self.shape)

    def trajectory(self, name):
        rows = load(name, np.float64).reshape(-1, 17)
        return rows[:, 0], rows[:, 1:].reshape(-1, 4, 4)


R = Reference()


def padded(image):
    """The same image inside a larger one: rows are farther apart."""
    big = np.zeros((image.shape[0], image.shape[1] + 7), image.dtype)
    big[:, 3:-4] = image
    return big[:, 3:-4]


def channel(image):
    """The same image as one channel of three: pixels are farther apart."""
    return np.dstack([0 * image, image, 0 * image])[:, :, 1]


class SameAsCpp(unittest.TestCase):
    def same(self, array, name):
        np.testing.assert_array_equal(array, R.matrix(name, len(array)), err_msg=name)

    def test_align(self):
        I0, D0 = R.frame(0)
        I1, D1 = R.frame(FRAMES - 1)
        K = np.array([[R.K[0], 0, R.K[2]], [0, R.K[1], R.K[3]], [0, 0, 1]])
        layouts = {
            "contiguous": lambda a: a,
            "padded rows": padded,
            "one channel of three": channel,
            "columns first": np.asfortranarray,
            "other byte order": lambda a: a.astype(a.dtype.newbyteorder()),
        }
        for name, layout in layouts.items():
            with self.subTest(name):
                found = apso.align(layout(I0), layout(D0), layout(I1), layout(D1), K, depth_unit=UNIT)
                self.assertEqual(found.status, R.values["align.status"])
                self.assertTrue(found.ok)
                self.assertEqual(found.confidence, R.number("align.confidence"))
                self.same(found.T, "align.T")
                self.same(found.information, "align.information")

    def test_align_float(self):
        images = [load(name, np.float32).reshape(R.shape) for name in ("intensity0.f32", "metres0.f32", "intensity1.f32", "metres1.f32")]
        self.same(apso.align(*images, R.K).T, "align_float.T")

    def test_score(self):
        I, D = R.frame(0)
        keypoints = load("keypoints0.f64", np.float64).reshape(-1, 5)
        a = apso.score(I, D, R.K, keypoints=keypoints, depth_unit=UNIT)
        self.check_assessment(a, "score")
        self.assertIn("INITIALISING", a.explain())
        self.assertIsNone(apso.score(I, D, R.K, depth_unit=UNIT).scores["S_feature"])
        self.assertLess(apso.score(I, D, R.K, keypoints=keypoints[:5], depth_unit=UNIT).S_total, a.S_total)

    def check_assessment(self, a, name):
        self.assertEqual(a.state, R.values[name + ".state"])
        self.assertEqual(a.S_total, R.number(name + ".S_total"))
        for score, value in a.scores.items():
            if value is None:
                self.assertNotIn(f"{name}.{score}", R.values)
            else:
                self.assertEqual(value, R.number(f"{name}.{score}"), f"{name}.{score}")

    def test_blend(self):
        T = R.matrix("align.T", 4)
        other = R.matrix("blend.other", 4)
        self.same(apso.blend(other, T, 0.5), "blend.half")
        self.same(apso.blend(other, T, 0.3, 1e4 * np.eye(6), R.matrix("align.information", 6)), "blend.information")
        np.testing.assert_array_equal(apso.blend(other, T, 1.0), other)
        np.testing.assert_array_equal(apso.blend(other, T, 0.0), T)
        np.testing.assert_array_equal(apso.blend(np.full((4, 4), np.nan), T, 0.5), T)

    def test_evaluate(self):
        truth, estimate = R.trajectory("truth.f64"), R.trajectory("estimate.f64")
        for alignment in ("se3", "sim3", "yaw"):
            e = apso.evaluate(truth, estimate, alignment=alignment, unit="f")
            self.assertEqual(e.ate.rmse, R.number(f"ate_{alignment}.rmse"))
            self.assertEqual(e.scale, R.number(f"ate_{alignment}.scale"))
            self.same(e.T_groundtruth_estimate, f"ate_{alignment}.T")
            self.assertEqual(e.ate.count, FRAMES)
            np.testing.assert_array_equal(e.pairs, np.arange(FRAMES)[:, None] * [1, 1])
            self.assertAlmostEqual(np.sqrt(np.mean(e.errors**2)), e.ate.rmse, places=15)
            if alignment != "sim3":
                self.assertEqual(e.rpe_translation.rmse, R.number("rpe.translation"))
                self.assertEqual(e.rpe_rotation.rmse, R.number("rpe.rotation"))

    def test_pipeline(self):
        tracker, pipeline = apso.Tracker(R.K, R.shape), apso.Pipeline(R.K, R.shape)
        moving = None
        for i in range(FRAMES):
            I, D = (padded(x) for x in R.frame(i))
            keypoints = load(f"keypoints{i}.f64", np.float64).reshape(-1, 5)
            tracks = load(f"tracks{i}.f64", np.float64).reshape(-1, 6)
            descriptors = load(f"descriptors{i}.u8", np.uint8).reshape(-1, 32)
            t = R.number(f"frame{i}.timestamp")
            # [pipeline]
            tracker.begin(t, I, D, keypoints, descriptors, tracks=tracks, depth_unit=UNIT)
            prior = tracker.estimate(moving)
            moving = pipeline.observe(t, I, D, prior.T, tracks=tracks, depth_unit=UNIT)
            pose = tracker.estimate(moving)
            pipeline.assess(pose.T, T_predicted=pose.T_predicted, ok=pose.ok, keypoints=keypoints, tracks=tracks,
                            information=pose.information)
            report = pipeline.conclude()
            tracker.commit(report.T, moving, keyframe_allowed=report.keyframe_allowed)
            # [/pipeline]
            self.assertEqual(report.state, R.values[f"frame{i}.reported"])
            self.assertEqual(pipeline.dynamic_ratio, R.number(f"frame{i}.dynamic_ratio"))
            self.same(pose.T, f"frame{i}.T_feature")
            self.same(report.T, f"frame{i}.T")
            self.check_assessment(report.assessment, f"frame{i}")

    def test_the_map_moves(self):
        """After correct() everything is as in a run in the other world; a refused pose changes nothing."""
        shift = np.eye(4)
        shift[:2, :2] = [[0.8, -0.6], [0.6, 0.8]]
        shift[:3, 3] = [1, -2, 3]
        stays, moves = apso.Pipeline(R.K, R.shape), apso.Pipeline(R.K, R.shape)
        asked = []
        for i in range(FRAMES):
            I, D = R.frame(i)
            t, T = R.number(f"frame{i}.timestamp"), R.matrix(f"frame{i}.T_feature", 4)
            if i == 6:
                with self.assertRaisesRegex(ValueError, r"what pose_of returns has shape \(2, 2\): expected \(4, 4\)"):
                    moves.correct(lambda t, T: np.eye(2))
                with self.assertRaisesRegex(ZeroDivisionError, "division"):
                    moves.correct(lambda t, T: 1 / 0)
                moves.correct(lambda t, T: asked.append(t) or shift @ T)
            reports = []
            for pipeline, change in (stays, np.eye(4)), (moves, shift if i >= 6 else np.eye(4)):
                pipeline.observe(t, I, D, change @ T, depth_unit=UNIT)
                pipeline.assess(change @ T)
                reports.append(pipeline.conclude())
            np.testing.assert_allclose(reports[1].T, (shift if i >= 6 else np.eye(4)) @ reports[0].T, atol=1e-9)
            self.assertEqual(reports[0].state, reports[1].state)
        self.assertTrue(reports[0].refined)
        self.assertIn(R.number("frame5.timestamp"), asked)
        moves.correct(lambda t, T: None)  # all stays where it is

    def test_a_map_in_parts(self):
        tracker, rng = apso.Tracker(R.K, R.shape), np.random.default_rng(1)
        events = []
        for i in range(60):  # the room, then for more than a second features that nobody has seen, the same ones over and over
            I, D = R.frame(min(i, 5))
            keypoints = load(f"keypoints{min(i, 5)}.f64", np.float64).reshape(-1, 5)
            if i <= 6:
                descriptors = rng.integers(0, 256, (len(keypoints), 32), np.uint8) if i == 6 else load(
                    f"descriptors{i}.u8", np.uint8).reshape(-1, 32)
            tracker.begin(i / 30, I, D, keypoints, descriptors, depth_unit=UNIT)
            pose = tracker.estimate()
            tracker.commit(pose.T, keyframe_allowed=i < 6)
            events.append(tracker.reconnect())
        self.assertEqual({e.event for e in events}, {"none", "left"})
        left = next(i for i, e in enumerate(events) if e.event == "left")
        self.assertGreaterEqual(left - 6, 29)  # a second at 30 Hz
        self.assertEqual([events[left].before, events[left].part, events[-1].before], [0, 1, 1])
        np.testing.assert_array_equal(events[left].T_part_before, np.eye(4))
        T = R.matrix("frame1.T_feature", 4)
        for e in events[0], events[left]:  # these move no pose
            self.assertFalse(e.moves_poses)
            np.testing.assert_array_equal(e.moved(0.5, T), T)
        with self.assertRaisesRegex(ValueError, r"T_world_camera has shape \(2, 2\): expected \(4, 4\)"):
            events[0].moved(0.5, np.eye(2))


class Arguments(unittest.TestCase):
    def setUp(self):
        self.I, self.D = R.frame(0)

    def test_shapes_are_named(self):
        small = self.D[::2, ::2]
        with self.assertRaisesRegex(ValueError, r"I0 has shape \(480, 640\) and D0 has shape \(240, 320\)"):
            apso.align(self.I, small, self.I, self.D, R.K, depth_unit=UNIT)
        with self.assertRaisesRegex(ValueError, r"I0 has shape \(480, 640\) and I1 has shape \(240, 320\)"):
            apso.align(self.I, self.D, self.I[::2, ::2], small, R.K, depth_unit=UNIT)
        with self.assertRaisesRegex(ValueError, r"I1 has shape \(480, 640, 3\): expected an image of two dimensions"):
            apso.align(self.I, self.D, np.dstack([self.I] * 3), self.D, R.K, depth_unit=UNIT)
        with self.assertRaisesRegex(ValueError, r"K has shape \(2, 2\): expected \(3, 3\)"):
            apso.align(self.I, self.D, self.I, self.D, np.eye(2), depth_unit=UNIT)
        with self.assertRaisesRegex(ValueError, r"guess has shape \(3, 3\): expected \(4, 4\)"):
            apso.align(self.I, self.D, self.I, self.D, R.K, depth_unit=UNIT, guess=np.eye(3))
        with self.assertRaisesRegex(ValueError, r"keypoints has shape \(3, 1\): expected \(N, 2 or more\)"):
            apso.score(self.I, self.D, R.K, depth_unit=UNIT, keypoints=np.zeros((3, 1)))
        with self.assertRaisesRegex(ValueError, r"I has shape \(480, 640\) and the camera has shape \(100, 200\)"):
            apso.Pipeline(R.K, (100, 200)).observe(0, self.I, self.D, np.eye(4), depth_unit=UNIT)
        with self.assertRaisesRegex(ValueError, r"mask has shape \(10, 10\) and the camera has shape \(480, 640\)"):
            apso.Pipeline(R.K, R.shape).observe(0, self.I, self.D, np.eye(4), depth_unit=UNIT, mask=np.zeros((10, 10), bool))
        with self.assertRaisesRegex(ValueError, r"descriptors has shape \(1, 32\): expected \(2, 32\)"):
            apso.Tracker(R.K, R.shape).begin(0, self.I, self.D, np.ones((2, 2)), np.zeros((1, 32), np.uint8), depth_unit=UNIT)
        with self.assertRaisesRegex(ValueError, r"estimate has shape \(3, 7\): expected \(N, 8\)"):
            apso.evaluate(np.zeros((3, 8)) + [0, 0, 0, 0, 0, 0, 0, 1], np.zeros((3, 7)))

    def test_types_are_named(self):
        with self.assertRaisesRegex(TypeError, "I0 has dtype float64, expected uint8, uint16 or float32"):
            apso.align(self.I / 255.0, self.D, self.I, self.D, R.K, depth_unit=UNIT)
        with self.assertRaisesRegex(ValueError, "D0 has integers: give their unit, depth_unit=1/5000"):
            apso.align(self.I, self.D, self.I, self.D, R.K)
        with self.assertRaisesRegex(ValueError, "its strides are negative"):
            apso.align(self.I[::-1], self.D, self.I, self.D, R.K, depth_unit=UNIT)
        with self.assertRaisesRegex(ValueError, "guess is no rigid motion"):
            apso.align(self.I, self.D, self.I, self.D, R.K, depth_unit=UNIT, guess=2 * np.eye(4))
        with self.assertRaisesRegex(ValueError, "fx"):
            apso.align(self.I, self.D, self.I, self.D, (0, 1, 2, 3), depth_unit=UNIT)
        with self.assertRaisesRegex(ValueError, "alignment is 'rigid', expected one of se3, none, sim3, yaw"):
            apso.evaluate(R.trajectory("truth.f64"), R.trajectory("truth.f64"), alignment="rigid")

    def test_options(self):
        align = lambda options: apso.align(self.I, self.D, self.I, self.D, R.K, depth_unit=UNIT, options=options)
        with self.assertRaisesRegex(ValueError, "there is no option 'alignment.alfa'"):
            align({"alignment.alfa": 1})
        with self.assertRaisesRegex(TypeError, "option 'alignment.alpha' is 'much', expected a number"):
            align({"alignment.alpha": "much"})
        with self.assertRaisesRegex(ValueError, "alpha"):
            align({"alignment.alpha": -1})
        with self.assertRaisesRegex(ValueError, "option 'alignment.scale' is 'none', expected one of "):
            align({"alignment.scale": "none"})
        self.assertEqual(align({"backward": True, "alignment.alpha": 1.5}).status, "Converged")
        with self.assertRaisesRegex(ValueError, "there is no option 'thread'"):
            apso.Pipeline(R.K, R.shape, options={"thread": 1})

    def test_evaluate_files(self):
        stamps, poses = R.trajectory("truth.f64")
        rows = np.column_stack([stamps, poses[:, :3, 3], np.zeros((FRAMES, 3)), np.ones(FRAMES)])
        self.assertLess(apso.evaluate((stamps, poses), rows).ate.rmse, 1e-12)
        with self.assertRaisesRegex(ValueError, "0 pairs of poses within 0.02"):
            apso.evaluate(rows, rows + [100, 0, 0, 0, 0, 0, 0, 0])
        with self.assertRaisesRegex(ValueError, "strictly increasing"):
            apso.evaluate(rows, rows[::-1])
        with self.assertRaisesRegex(ValueError, "the quaternion of pose 0 is none"):
            apso.evaluate(rows, 0 * rows)

    def test_masks(self):
        def ratio(mask):
            pipeline = apso.Pipeline(R.K, R.shape, options={"motion": False})
            return pipeline.observe(0, self.I, self.D, np.eye(4), depth_unit=UNIT, mask=mask).mean()

        half = np.zeros(R.shape, bool)
        half[:, : R.width // 2] = True
        self.assertGreater(ratio(half), 0.3)
        self.assertEqual(ratio(half), ratio(half.astype(np.uint8) * 255))
        self.assertEqual(ratio(half), ratio(half.astype(np.float32)))
        self.assertLess(ratio(~half & False), 0.1)

    def test_nothing_is_kept_or_changed(self):
        counts = [sys.getrefcount(self.I), sys.getrefcount(self.D)]
        before = self.I.copy(), self.D.copy()
        for _ in range(3):
            apso.align(self.I, self.D, self.I, self.D, R.K, depth_unit=UNIT)
            apso.score(self.I, self.D, R.K, depth_unit=UNIT)
        self.assertEqual(counts, [sys.getrefcount(self.I), sys.getrefcount(self.D)])
        np.testing.assert_array_equal(self.I, before[0])
        np.testing.assert_array_equal(self.D, before[1])

    def test_the_interpreter_is_free_meanwhile(self):
        """A thread of Python counts while another aligns; with the lock held it would stand still."""
        ticks, done = [], threading.Event()

        def count():
            while not done.is_set():
                ticks.append(time.perf_counter())
                time.sleep(0.0005)

        thread = threading.Thread(target=count)
        thread.start()
        begin = time.perf_counter()
        apso.align(self.I, self.D, *R.frame(FRAMES - 1), R.K, depth_unit=UNIT, options={"backward": True})
        end = time.perf_counter()
        done.set()
        thread.join()
        self.assertGreater(sum(begin < t < end for t in ticks), 3)


if __name__ == "__main__":
    unittest.main()
