/* apso behind plain data: a host sees this header only, whatever its C++ standard, and apso_bridge.cpp is compiled as C++17.
   No type of Eigen, OpenCV or the standard library crosses this line, because their layout may differ between the sides.

   A frame goes like this:
     apso_bridge_observe    the images are there: what moves?
     apso_bridge_conclude   the host has tracked: judges the frame, repairs the pose of a BAD one
     apso_bridge_settle     before the next frame, or before the pose is built upon: the refined pose of a GOOD one
     apso_bridge_presence   which points of the map are no longer where they were

   Poses are 12 doubles, the first three rows of T_world_camera, row after row: R00 R01 R02 tx R10 ... tz [m].
   A call that returns int returns 0 when it worked; else apso_bridge_error() says what was wrong. To be called from one thread. */
#ifndef APSO_BRIDGE_H
#define APSO_BRIDGE_H

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ApsoBridge ApsoBridge;

/* Which frames direct alignment refines. */
enum { APSO_REFINE_NONE = 0, APSO_REFINE_BAD = 1, APSO_REFINE_EVERY = 2 };

typedef struct {
  int refine;     /* APSO_REFINE_EVERY; with APSO_REFINE_BAD GOOD frames keep the pose of the host */
  int own_thread; /* 1: GOOD frames are refined and remembered beside the work of the host; 0: within apso_bridge_conclude() */
  double inverse_depth_sigma; /* of a depth, with what its neighbours share [1/m]: 0.012 for a Kinect or an Xtion; 0: not known */
} ApsoBridgeOptions;

typedef struct {
  float x, y;     /* [px], rectified */
  float response; /* of the detector, >= 0 */
  float angle;    /* [deg], [0, 360) */
  int octave;
  float depth;        /* [m]; 0: none */
  float sigma;        /* of x and y [px] */
  long long point_id; /* of the map point it was matched to as an inlier; -1: none */
  float point[3];     /* that map point, in the world [m] */
} ApsoBridgeKeypoint;

typedef struct {
  long long id;                 /* the same in all frames */
  float x, y;                   /* [px], rectified */
  float previous_x, previous_y; /* in the frame before */
  int age;                      /* frames since it was begun */
} ApsoBridgeTrack;

typedef struct {
  double T_world_camera[12];
  double confidence;    /* of the direct pose, [0, 1]; 0 without one */
  int pose_ok;          /* there is a pose to go on with */
  int refined;          /* T_world_camera is not the pose given but one that direct alignment or the prediction has a part in */
  int keyframe_allowed; /* the map may learn from this frame */
  int unsettled;        /* the pose is being refined: apso_bridge_settle() tells what has become of it */
  const char* state;    /* "GOOD", "BAD" ..., for logs; valid until the next call */
} ApsoBridgeReport;

/* Of the last frame [ms]. */
typedef struct {
  double observed;   /* within apso_bridge_observe() */
  double concluded;  /* within apso_bridge_conclude() */
  double settled;    /* beside the host, after apso_bridge_conclude() */
} ApsoBridgeTimes;

/* MOVING: something that moves is there or close by; a point of it may be GONE later. */
enum { APSO_POINT_UNKNOWN = 0, APSO_POINT_PRESENT = 1, APSO_POINT_GONE = 2, APSO_POINT_MOVING = 3 };

/* The pose now of the frame of this time stamp, whose pose was T_world_camera so far. Returns 1 and writes over the pose, or 0 where
   the frame is not known. */
typedef int (*ApsoBridgePoseOf)(void* context, double timestamp, double* T_world_camera);

/* fx, fy, cx, cy [px] of the rectified camera. options: null for APSO_REFINE_EVERY, with an own thread. Returns null when something is
   wrong with them. */
ApsoBridge* apso_bridge_create(double fx, double fy, double cx, double cy, int width, int height, const ApsoBridgeOptions* options);
void apso_bridge_destroy(ApsoBridge* bridge);
/* The map begins anew. */
void apso_bridge_reset(ApsoBridge* bridge);
const char* apso_bridge_error(const ApsoBridge* bridge);

/* Before tracking. Steps are bytes from a row to the next. The depth image must live until the last apso_bridge_presence().
   T_world_camera_prior: where the camera is expected, e.g. by constant velocity.
   T_world_camera_previous: of the frame before, where the tracks come from; null if it is not known. With it the tracks tell the motion
   since then, and a prior that is wrong does no harm.
   tracks: corners followed since the frame before; what begins to move shows in them first.
   mask: what the host knows to move, nonzero = moves; null: nothing. */
int apso_bridge_observe(ApsoBridge* bridge, double timestamp, const unsigned char* grey, int grey_step, const float* depth_metres,
                        int depth_step, const double* T_world_camera_prior, const double* T_world_camera_previous,
                        const ApsoBridgeTrack* tracks, int count, const unsigned char* mask, int mask_step);
/* Where the tracks say the camera is, else the prior. Returns how many tracks agree with it, 0 where they say nothing. Valid after
   apso_bridge_observe(). */
int apso_bridge_expected(const ApsoBridge* bridge, double* T_world_camera);
/* 255 where something moves, else 0; width x height without padding, valid until the next apso_bridge_observe(). Null before the first. */
const unsigned char* apso_bridge_mask(const ApsoBridge* bridge);
/* What a pose was found by: nothing; the points of the map; the tracks of apso_bridge_observe(), where apso_bridge_expected() is not 0. */
enum { APSO_BY_NOTHING = 0, APSO_BY_MAP = 1, APSO_BY_TRACKS = 2 };

/* After tracking. T_world_camera_tracked is read with APSO_BY_MAP alone. The report has a pose where the map or the alignment tells one;
   with APSO_BY_TRACKS the alignment is joined with what the tracks tell. */
int apso_bridge_conclude(ApsoBridge* bridge, const ApsoBridgeKeypoint* keypoints, int count, const double* T_world_camera_tracked,
                         int found_by, ApsoBridgeReport* report);
/* After apso_bridge_conclude(): waits until the frame is refined. The same report, with the pose that the frame has now. */
int apso_bridge_settle(ApsoBridge* bridge, ApsoBridgeReport* report);
/* After apso_bridge_conclude(), while the images live: APSO_POINT_* of `count` points of the map, x y z each [m], seen from a pose. */
int apso_bridge_presence(ApsoBridge* bridge, const double* T_world_camera, const float* points, int count, unsigned char* presence);
/* Before apso_bridge_observe(): takes over what the host's back end has changed. */
int apso_bridge_correct(ApsoBridge* bridge, ApsoBridgePoseOf pose_of, void* context);
ApsoBridgeTimes apso_bridge_times(ApsoBridge* bridge);

#ifdef __cplusplus
}
#endif
#endif
