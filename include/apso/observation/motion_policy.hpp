/// \file
/// What a motion policy is. A motion policy says where a frame moves; it is one struct with three members:
/// \code
///   struct MyMotion {
///     // before the pose is known: where does this frame move?
///     void observe(const apso::AnyFrame& frame, const apso::Pose& T_world_camera_prior,
///                  const std::vector<apso::PointTrack>& tracks, apso::DynamicMask& out);
///     // once the pose is final
///     void remember(const apso::AnyFrame& frame, const apso::Pose& T_world_camera, const apso::DynamicMask& mask);
///     // forgets everything
///     void reset();
///   };
/// \endcode
/// `out` gets the size of the frame; where a policy has no evidence it says "unknown" (DynamicMask::known = 0), never
/// "static". A policy that finds objects also has `const std::vector<Detection>& detections() const`, those of the last
/// frame observed; masks in them live until the next call of observe(). Nothing that is passed may be kept.
///
/// The policies of apso, their combinations and AnyMotionPolicy are called with your own types as well: any frame, any
/// pose, any range of tracks.
#pragma once

#include <type_traits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

namespace detail {
template <class P>
using policy_observe_t = decltype(std::declval<P&>().observe(std::declval<const AnyFrame&>(), std::declval<const Pose&>(),
                                                             std::declval<const std::vector<PointTrack>&>(), std::declval<DynamicMask&>()));
template <class P>
using policy_remember_t =
    decltype(std::declval<P&>().remember(std::declval<const AnyFrame&>(), std::declval<const Pose&>(), std::declval<const DynamicMask&>()));
template <class P>
using policy_reset_t = decltype(std::declval<P&>().reset());
template <class P>
using policy_detections_t = decltype(std::declval<const P&>().detections());

template <template <class> class Member, class P, class = void>
struct has_member : std::false_type {};
template <template <class> class Member, class P>
struct has_member<Member, P, std::void_t<Member<P>>> : std::true_type {};
template <class P, class = void>
struct finds_objects : std::false_type {};
template <class P>
struct finds_objects<P, std::void_t<policy_detections_t<P>>> : std::is_convertible<policy_detections_t<P>, const std::vector<Detection>&> {
};
}  // namespace detail

/// True when P has the members of a motion policy.
template <class P>
inline constexpr bool is_motion_policy_v = detail::has_member<detail::policy_observe_t, P>::value&&
    detail::has_member<detail::policy_remember_t, P>::value&& detail::has_member<detail::policy_reset_t, P>::value;

/// Names every member that P lacks, in the compiler's message.
template <class P>
struct require_motion_policy {
  static_assert(detail::has_member<detail::policy_observe_t, P>::value,
                "apso: a motion policy needs `void observe(const apso::AnyFrame& frame, const apso::Pose& "
                "T_world_camera_prior, const std::vector<apso::PointTrack>& tracks, apso::DynamicMask& out);`");
  static_assert(detail::has_member<detail::policy_remember_t, P>::value,
                "apso: a motion policy needs `void remember(const apso::AnyFrame& frame, const apso::Pose& "
                "T_world_camera, const apso::DynamicMask& mask);`");
  static_assert(detail::has_member<detail::policy_reset_t, P>::value, "apso: a motion policy needs `void reset();`");
};

/// Stands first in everything that takes a motion policy of the user; see check_image.
template <class P>
constexpr require_motion_policy<P> check_motion_policy() {
  return {};
}

/// The objects a policy found in the last frame; none for a policy that finds no objects.
template <class P>
[[nodiscard]] const std::vector<Detection>& detections_of(const P& policy) {
  if constexpr (detail::finds_objects<P>::value) {
    return policy.detections();
  } else {
    static const std::vector<Detection> nothing;
    return nothing;
  }
}

/// Options of a policy that has none.
struct NoOptions {
  template <class Self, class V>
  static void fields(Self&, V&&) {}
};

template <class A, class B>
class CombinedPolicy;

namespace detail {
template <class A, class B>
using combined_t = std::enable_if_t<is_motion_policy_v<std::decay_t<A>> || is_motion_policy_v<std::decay_t<B>>,
                                    CombinedPolicy<std::decay_t<A>, std::decay_t<B>>>;
}  // namespace detail

/// How two policies become one.
enum class PolicyCombination {
  Union,    ///< `p | q`: dynamic where either says so
  Product,  ///< `p * q`: dynamic where both say so, pixel by pixel
  Gate      ///< `p & q`: what p marks, object by object, where q sees it move: "a person, and it moves"
};

/// Empty base of the policies of apso: two policies of which one has it are joined by operators, e.g.
/// `GeometricMotion(camera) | MyMotion{}`. See CombinedPolicy in combined_policy.hpp.
struct PolicyOperators {
  template <class A, class B>
  friend detail::combined_t<A, B> operator|(A&& p, B&& q) {
    return {std::forward<A>(p), std::forward<B>(q), PolicyCombination::Union};
  }
  template <class A, class B>
  friend detail::combined_t<A, B> operator*(A&& p, B&& q) {
    return {std::forward<A>(p), std::forward<B>(q), PolicyCombination::Product};
  }
  template <class A, class B>
  friend detail::combined_t<A, B> operator&(A&& p, B&& q) {
    return {std::forward<A>(p), std::forward<B>(q), PolicyCombination::Gate};
  }
};

namespace detail {
// Base of the policies around another one, `inner_`: what the outer one does not do itself, the inner one does.
template <class Inner>
class PolicyAround : public PolicyOperators {
 public:
  void remember(const AnyFrame& frame, const AnyPose& T_world_camera, const DynamicMask& mask) {
    const Pose& T = T_world_camera;
    inner_.remember(frame, T, mask);
  }
  void reset() { inner_.reset(); }
  [[nodiscard]] const std::vector<Detection>& detections() const { return detections_of(inner_); }

 protected:
  explicit PolicyAround(Inner inner) : inner_(std::move(inner)) { check_motion_policy<Inner>(); }
  void observe_inner(const AnyFrame& frame, const Pose& T_world_camera_prior, const AnyTracks& tracks, DynamicMask& out) {
    inner_.observe(frame, T_world_camera_prior, tracks.in(tracks_), out);
  }
  Inner inner_;

 private:
  std::vector<PointTrack> tracks_;
};
}  // namespace detail

/// Sees nothing: everything is unknown.
class NoMotion : public PolicyOperators {
 public:
  using Options = NoOptions;
  void observe(const AnyFrame& frame, const AnyPose&, const AnyTracks&, DynamicMask& out) {
    set_unknown(frame.depth().width(), frame.depth().height(), out);
  }
  void remember(const AnyFrame&, const AnyPose&, const DynamicMask&) {}
  void reset() {}
};

APSO_NAMESPACE_END
