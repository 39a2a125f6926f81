/// \file
/// The thresholds of the initialisation, th_f (eq. Adaptive_Frame) and th_s (eq. Adaptive_Quality), and the search
/// for the initial frame (eq. Initial) that uses them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include <apso/config.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// How the length of the window grows once a decision is due.
enum class FrameThreshold {
  Literal,   ///< th_f exp(max(0, n / th_f - 1)), as printed
  Geometric  ///< ceil(1.5 th_f)
};
constexpr std::array<const char*, 2> enum_names(FrameThreshold) { return {"literal", "geometric"}; }

/// How the required score falls with time.
enum class QualityThreshold {
  ClosedForm,  ///< th_s0 (1 - beta ln(max(1, n / th_f0))): continuous and falling
  Literal      ///< beta th_s log(th_f / n), recursive as printed, limited to [th_smin, 1]
};
constexpr std::array<const char*, 2> enum_names(QualityThreshold) { return {"closed_form", "literal"}; }

/// Which frame is committed.
enum class InitialFrame {
  BestInWindow,  ///< the best so far, when the window closes
  FirstPassing   ///< the first that reaches th_s
};
constexpr std::array<const char*, 2> enum_names(InitialFrame) { return {"best_in_window", "first_passing"}; }

/// What happens when th_fmax frames did not suffice.
enum class InitialTimeout {
  Degraded,  ///< the best frame is committed and flagged
  Restart    ///< the search begins anew
};
constexpr std::array<const char*, 2> enum_names(InitialTimeout) { return {"degraded", "restart"}; }

struct InitialisationOptions {
  double frames = 30;        ///< th_f0 [frames], 1 s of a 30 Hz camera
  double frames_max = 150;   ///< th_fmax [frames]
  double quality = 0.70;     ///< th_s0, [0,1]
  double quality_min = 0.45; ///< th_smin, (0, th_s0]
  double decay = 0.5;        ///< beta, >= 0
  FrameThreshold frame_threshold = FrameThreshold::Literal;
  QualityThreshold quality_threshold = QualityThreshold::ClosedForm;
  InitialFrame initial_frame = InitialFrame::BestInWindow;
  InitialTimeout timeout = InitialTimeout::Degraded;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("frames", s.frames, 1, 1000000);
    v("frames_max", s.frames_max, 1, 1000000);
    v("quality", s.quality, 1e-9, 1.0);
    v("quality_min", s.quality_min, 1e-9, 1.0);
    v("decay", s.decay, 0.0, 100.0);
    v("frame_threshold", s.frame_threshold);
    v("quality_threshold", s.quality_threshold);
    v("initial_frame", s.initial_frame);
    v("timeout", s.timeout);
  }
};

/// The next th_f at frame n (1-based) [frames].
[[nodiscard]] inline double next_frame_threshold(double th_f, double n, const InitialisationOptions& o = {}) {
  const double next = o.frame_threshold == FrameThreshold::Literal ? th_f * std::exp(std::max(0.0, n / th_f - 1.0))
                                                                   : std::ceil(1.5 * th_f);
  return std::min(o.frames_max, next);
}

/// th_s at frame n (1-based) in closed form.
[[nodiscard]] inline double quality_threshold(double n, const InitialisationOptions& o = {}) {
  return std::max(o.quality_min, o.quality * (1.0 - o.decay * std::log(std::max(1.0, n / o.frames))));
}

/// One step of the recursion for th_s as printed, not limited from above: it may exceed 1 by far.
[[nodiscard]] inline double literal_quality_threshold(double th_s, double th_f, double n,
                                                      const InitialisationOptions& o = {}) {
  return std::max(o.quality_min, o.decay * th_s * std::log(th_f / n));
}

/// Searches the initial reference frame.
class Initialiser {
 public:
  /// What to do with the frame just offered.
  struct Step {
    bool new_best = false;   ///< it is the best so far: keep it
    bool commit = false;     ///< the best frame so far becomes the reference
    bool degraded = false;   ///< ... although its score is too low
    bool restarted = false;  ///< the search failed and begins anew
  };

  explicit Initialiser(const InitialisationOptions& options = {}) : o_(options) {
    expects(o_.quality_min <= o_.quality, "initialisation: quality_min must be <= quality");
    expects(o_.frames <= o_.frames_max, "initialisation: frames must be <= frames_max");
    reset();
  }
  void reset() {
    n_ = 0;
    best_ = -1;
    th_f_ = o_.frames;
    th_s_ = o_.quality;
  }
  /// Takes the next frame.
  /// \param usable false: the frame counts but may not become the reference
  Step offer(Quality S_total, bool usable = true) {
    Step step;
    ++n_;
    const double n = n_;
    if (usable && S_total.value() > best_) {
      best_ = S_total.value();
      step.new_best = true;
    }
    const bool due = n >= th_f_;
    if (due && !(best_ >= 0 && best_ >= threshold_at(n)) && n < o_.frames_max) {
      th_f_ = next_frame_threshold(th_f_, n, o_);
    }
    if (o_.quality_threshold == QualityThreshold::Literal) {
      if (n_ > 1) th_s_ = std::min(1.0, literal_quality_threshold(th_s_, th_f_, n, o_));
    } else {
      th_s_ = quality_threshold(n, o_);
    }
    if (o_.initial_frame == InitialFrame::FirstPassing && usable && S_total.value() >= th_s_) {
      step.commit = step.new_best = true;
      best_ = S_total.value();
    } else if (due && best_ >= 0 && best_ >= th_s_) {
      step.commit = true;
    } else if (n >= o_.frames_max && best_ >= 0 && o_.timeout == InitialTimeout::Degraded) {
      step.commit = step.degraded = true;
    } else if (n >= o_.frames_max && o_.timeout == InitialTimeout::Restart) {
      reset();
      step = {};
      step.restarted = true;
    }
    return step;
  }
  [[nodiscard]] int frames() const { return n_; }                   ///< n, frames offered
  [[nodiscard]] double th_f() const { return th_f_; }               ///< [frames]
  [[nodiscard]] double th_s() const { return th_s_; }               ///< [0,1]
  [[nodiscard]] Quality best() const { return Quality(best_); }     ///< S* (0 when there is none)
  [[nodiscard]] bool has_best() const { return best_ >= 0; }

 private:
  [[nodiscard]] double threshold_at(double n) const {
    return o_.quality_threshold == QualityThreshold::Literal ? th_s_ : quality_threshold(n, o_);
  }
  InitialisationOptions o_;
  int n_ = 0;
  double best_ = -1;
  double th_f_ = 0;
  double th_s_ = 0;
};

APSO_NAMESPACE_END
