// expect: apso: camera_traits<T> needs `static bool project(const T& camera, const Eigen::Vector3d& X, Eigen::Vector2d& pixel);`
#include <apso/traits/camera.hpp>

struct MyCamera {};
template <>
struct apso::camera_traits<MyCamera> {
#ifdef CONTROL
  static bool project(const MyCamera&, const Eigen::Vector3d&, Eigen::Vector2d&) { return false; }
#endif
  static Eigen::Vector3d unproject(const MyCamera&, const Eigen::Vector2d&) { return {0, 0, 1}; }
};

apso::Pinhole use(const MyCamera& camera) { return apso::to_pinhole(camera, 640, 480); }
