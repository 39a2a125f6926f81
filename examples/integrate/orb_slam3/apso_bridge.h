/* apso behind plain data, for hosts that are not built as C++17. This header is C; apso_bridge.cpp is compiled as C++17.
   No type of Eigen, OpenCV or the standard library crosses this line, because their layout may differ between the sides.

   Poses are 12 doubles, the first three rows of T_world_camera, row after row: R00 R01 R02 tx R10 ... tz [m].
   A call that returns int returns 0 when it worked; else apso_bridge_error() says what was wrong. Not thread-safe. */
#ifndef APSO_BRIDGE_H
#define APSO_BRIDGE_H

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ApsoBridge ApsoBridge;

typedef struct {
  float x, y;     /* [px], rectified */
  float response; /* of the detector, >= 0 */
  float angle;    /* [deg], [0, 360) */
  int octave;
  long long point_id; /* of the map point it was matched to as an inlier; -1: none */
} ApsoBridgeKeypoint;

typedef struct {
  double T_world_camera[12];
  int pose_ok;          /* there is a pose to go on with */
  int refined;          /* T_world_camera is not the pose given but the repaired one */
  int keyframe_allowed; /* the map may learn from this frame */
  const char* state;    /* "GOOD", "BAD" ..., for logs; valid until the next call */
} ApsoBridgeReport;

/* fx, fy, cx, cy [px] of the rectified camera. Returns NULL when something is wrong with them. */
ApsoBridge* apso_bridge_create(double fx, double fy, double cx, double cy, int width, int height);
void apso_bridge_destroy(ApsoBridge* bridge);
void apso_bridge_reset(ApsoBridge* bridge);
const char* apso_bridge_error(const ApsoBridge* bridge);

/* Before tracking. Steps are bytes from a row to the next. Nothing is read after the call. */
int apso_bridge_observe(ApsoBridge* bridge, double timestamp, const unsigned char* grey, int grey_step, const float* depth_metres,
                        int depth_step, const double* T_world_camera_prior);
/* 1 when the pixel belongs to something that moves, by the last apso_bridge_observe. */
int apso_bridge_moves(const ApsoBridge* bridge, float x, float y);
/* After tracking. T_world_camera_tracked is not read when tracking_ok is 0. */
int apso_bridge_conclude(ApsoBridge* bridge, const ApsoBridgeKeypoint* keypoints, int count, const double* T_world_camera_tracked,
                         int tracking_ok, ApsoBridgeReport* report);

#ifdef __cplusplus
}
#endif
#endif
