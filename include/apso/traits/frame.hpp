/// \file
/// An RGB-D frame of your images: intensity, depth in metres, camera, time. Every algorithm that needs a frame takes one.
///
/// \code
/// const auto now = apso::frame(timestamp, grey, apso::scaled(depth, 1 / 5000.F), camera);
/// \endcode
#pragma once

#include <type_traits>
#include <utility>

#include <apso/config.hpp>
#include <apso/traits/camera.hpp>
#include <apso/traits/image.hpp>
#include <apso/traits/images/rows.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Refers to the images of one RGB-D frame. Made by frame(); copies no pixel. Named images must outlive it, views and
/// temporaries are taken along.
template <class HeldIntensity, class HeldDepth>
class Frame {
 public:
  Frame(double timestamp_, HeldIntensity intensity, HeldDepth depth, const Pinhole& camera_)
      : timestamp(timestamp_), camera(camera_), intensity_(std::move(intensity)), depth_(std::move(depth)) {}

  double timestamp;                ///< [s]
  Pinhole camera;                  ///< of both images
  ImageView<const Bgr8> colour{};  ///< optional; only networks ask for it

  [[nodiscard]] const typename HeldIntensity::type& intensity() const { return intensity_.get(); }  ///< in [0,1]
  [[nodiscard]] const typename HeldDepth::type& depth() const { return depth_.get(); }              ///< [m]

 private:
  HeldIntensity intensity_;
  HeldDepth depth_;
};

namespace detail {
template <class CameraT>
[[nodiscard]] Pinhole pinhole_of(const CameraT& camera, int width, int height) {
  if constexpr (std::is_same_v<CameraT, Pinhole>) {
    (void)width, (void)height;
    return camera;
  } else {
    return to_pinhole(camera, width, height);
  }
}
}  // namespace detail

/// A frame of your images.
/// \param timestamp [s]
/// \param intensity any image; 8 and 16 bit are brought to [0,1], float is in [0,1]
/// \param depth     any image in metres; raw integers say their unit: `scaled(depth, 1 / 5000.F)`. Registered to the
///                  intensity. Invalid is 0, negative, NaN, infinite or out of range
/// \param camera    a Pinhole or any type with camera_traits; contract_error if it is distorted or has another size
template <class I, class D, class CameraT>
[[nodiscard]] auto frame(double timestamp, I&& intensity, D&& depth, const CameraT& camera) {
  using IntensityT = std::decay_t<I>;
  using DepthT = std::decay_t<D>;
  check_image<IntensityT>();
  check_image<DepthT>();
  static_assert(!is_image_v<DepthT> || std::is_floating_point_v<typename image_traits<DepthT>::value_type>,
                "apso: integer depth needs its unit, e.g. `apso::scaled(depth, 1 / 5000.F)` for TUM files, "
                "`apso::scaled(depth, 0.001F)` for millimetres");
  const int width = image_traits<IntensityT>::width(intensity);
  const int height = image_traits<IntensityT>::height(intensity);
  expects(image_traits<DepthT>::width(depth) == width && image_traits<DepthT>::height(depth) == height,
          "frame: intensity and depth differ in size");
  const Pinhole pinhole = detail::pinhole_of(camera, width, height);
  pinhole.validate();
  expects(pinhole.width == width && pinhole.height == height, "frame: the camera has another size than the images");
  auto in_unit = as_intensity(std::forward<I>(intensity));
  using HeldIntensity = detail::ByValue<decltype(in_unit)>;
  using HeldDepth = detail::held_t<D>;
  return Frame<HeldIntensity, HeldDepth>(timestamp, HeldIntensity(std::move(in_unit)), HeldDepth(std::forward<D>(depth)), pinhole);
}

/// True for what frame() makes and for RgbdFrame: the two types that doors take as a frame.
template <class T>
inline constexpr bool is_frame_v = std::is_same_v<T, RgbdFrame>;
template <class I, class D>
inline constexpr bool is_frame_v<Frame<I, D>> = true;

/// Stands first in every function that takes a frame; see check_image.
template <class T>
constexpr void check_frame() {
  static_assert(is_frame_v<T>, "apso: a frame is made by `apso::frame(timestamp, intensity, depth, camera)` from any images");
}

/// Intensity of a frame: an image in [0,1], read with rows().
template <class I, class D>
[[nodiscard]] const auto& intensity_of(const Frame<I, D>& frame) {
  return frame.intensity();
}
[[nodiscard]] inline const ImageView<const float>& intensity_of(const RgbdFrame& frame) { return frame.intensity; }

/// Depth of a frame: an image in metres, read with rows().
template <class I, class D>
[[nodiscard]] const auto& depth_of(const Frame<I, D>& frame) {
  return frame.depth();
}
[[nodiscard]] inline const ImageView<const float>& depth_of(const RgbdFrame& frame) { return frame.depth; }

APSO_NAMESPACE_END
