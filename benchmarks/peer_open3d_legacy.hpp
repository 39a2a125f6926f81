// Open3D's hybrid RGB-D odometry of before its tensors, in plain numbers; see peer_open3d_legacy.cpp.
#pragma once

struct Open3dLegacy;

extern "C" {
#define APSO_SHOWN __attribute__((visibility("default")))
APSO_SHOWN Open3dLegacy* open3d_legacy_create();
APSO_SHOWN void open3d_legacy_destroy(Open3dLegacy* o);
APSO_SHOWN void open3d_legacy_camera(Open3dLegacy* o, int width, int height, double fx, double fy, double cx, double cy);
/// Copies a frame: intensity in [0,1], depth [m].
APSO_SHOWN void open3d_legacy_frame(Open3dLegacy* o, int is_target, const float* intensity, const float* depth, int width, int height);
/// T_target_source, 4 x 4 row by row. \return its own verdict
APSO_SHOWN int open3d_legacy_solve(Open3dLegacy* o, const double* guess, double* found);
#undef APSO_SHOWN
}
