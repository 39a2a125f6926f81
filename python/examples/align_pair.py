"""Scores and aligns two RGB-D frames of a recording in the format of TUM, and draws how the picture has moved.

usage: align_pair.py RGB0 DEPTH0 RGB1 DEPTH1 FX FY CX CY PICTURE      (PNG files, 16-bit depth of 1/5000 m; PICTURE .png or .svg)
"""
import sys

import matplotlib

matplotlib.use("Agg")  # to a file, without a window
# [pair]
import matplotlib.pyplot as plt
import numpy as np

import apso

K = np.array(sys.argv[5:9], float)  # fx, fy, cx, cy [px]
I0, I1 = (plt.imread(f)[..., :3].mean(axis=-1, dtype=np.float32) for f in sys.argv[1:4:2])  # grey in [0, 1]
D0, D1 = (plt.imread(f) * np.float32(65535 / 5000) for f in sys.argv[2:5:2])  # metres

pair = apso.align(I0, D0, I1, D1, K)  # where did the camera go?
print(f"{pair.status}, confidence {pair.confidence:.2f}, moved by {pair.T[:3, 3].round(4)} m")
print(apso.score(I1, D1, K).explain())  # can the second frame be trusted?

v, u = np.nonzero((D0 > 0) & (np.indices(D0.shape) % 40 == 20).all(axis=0))  # some pixels, and where they are in the second frame
X = pair.T[:3, :3] @ (D0[v, u] * [(u - K[2]) / K[0], (v - K[3]) / K[1], np.ones(len(u))]) + pair.T[:3, 3:]
plt.imshow(I1, cmap="gray")
plt.quiver(u, v, K[0] * X[0] / X[2] + K[2] - u, K[1] * X[1] / X[2] + K[3] - v, angles="xy", scale_units="xy", scale=1, color="orange")
plt.title(f"motion of static points [px], {pair.status}, confidence {pair.confidence:.2f}")
plt.savefig(sys.argv[9])
# [/pair]
