// expect: apso: pose_traits<T> needs `using scalar = double;` (or float)
#include <apso/pipeline/pipeline.hpp>

#ifdef CONTROL
using MyPose = Eigen::Matrix4d;
#else
struct MyPose {};
#endif

void use(apso::BasicPipeline<MyPose>& pipeline) { pipeline.reset(); }
