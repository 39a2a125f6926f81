/// \file
/// The thresholds of the initialisation, th_f by equation (4) and th_s by equation (5), and the search for the initial
/// frame by equation (3) that uses them.
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
  double frames = 30;         ///< th_f at the start [frames]: 1 s of a 30 Hz camera
  double frames_max = 150;    ///< th_fmax [frames]
  double quality = 0.70;      ///< th_s at the start, [0,1]: ordinary frames score 0.76 to 0.98
  double quality_min = 0.45;  ///< th_smin, (0, quality]
  double decay = 0.5;         ///< beta, >= 0
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
  const double next = o.frame_threshold == FrameThreshold::Literal ? th_f * std::exp(std::max(0.0, n / th_f - 1.0)) : std::ceil(1.5 * th_f);
  return std::min(o.frames_max, next);
}

/// th_s at frame n (1-based) in closed form.
[[nodiscard]] inline double quality_threshold(double n, const InitialisationOptions& o = {}) {
  return std::max(o.quality_min, o.quality * (1.0 - o.decay * std::log(std::max(1.0, n / o.frames))));
}

/// One step of the recursion for th_s as printed, not limited from above: it may exceed 1 by far.
[[nodiscard]] inline double literal_quality_threshold(double th_s, double th_f, double n, const InitialisationOptions& o = {}) {
  return std::max(o.quality_min, o.decay * th_s * std::log(th_f / n));
}

/// th_f and th_s from frame to frame, by equations (4) and (5) in the forms that the options choose. A rule of your own has
/// the same members.
class AdaptiveThresholds {
 public:
  explicit AdaptiveThresholds(const InitialisationOptions& options = {}) : o_(options) { reset(); }
  void reset() {
    th_f_ = o_.frames;
    th_s_ = o_.quality;
  }
  /// At frame n (1-based), before it is decided whether the best frame so far becomes the reference.
  /// \param best its score, [0,1]; < 0 when there is none
  void next(int n, double best) {
    const bool literal = o_.quality_threshold == QualityThreshold::Literal;
    const bool passes = best >= 0 && best >= (literal ? th_s_ : quality_threshold(n, o_));
    if (n >= th_f_ && !passes && n < o_.frames_max) th_f_ = next_frame_threshold(th_f_, n, o_);
    if (!literal) th_s_ = quality_threshold(n, o_);
    else if (n > 1) th_s_ = std::min(1.0, literal_quality_threshold(th_s_, th_f_, n, o_));
  }
  [[nodiscard]] double frames() const { return th_f_; }   ///< th_f [frames]
  [[nodiscard]] double quality() const { return th_s_; }  ///< th_s, [0,1]

 private:
  InitialisationOptions o_;
  double th_f_ = 0;
  double th_s_ = 0;
};

/// Searches the initial reference frame, equation (3).
/// \tparam Thresholds the rule for th_f and th_s; see AdaptiveThresholds
template <class Thresholds = AdaptiveThresholds>
class BasicInitialiser {
 public:
  /// What to do with the frame just offered.
  struct Step {
    bool new_best = false;   ///< it is the best so far: keep it
    bool commit = false;     ///< the best frame so far becomes the reference
    bool degraded = false;   ///< ... although its score is too low
    bool restarted = false;  ///< the search failed and begins anew
  };

  explicit BasicInitialiser(const InitialisationOptions& options = {}) : o_(options), thresholds_(options) {
    expects(o_.quality_min <= o_.quality, "initialisation: quality_min must be <= quality");
    expects(o_.frames <= o_.frames_max, "initialisation: frames must be <= frames_max");
    reset();
  }
  void reset() {
    n_ = 0;
    best_ = -1;
    thresholds_.reset();
  }
  /// Takes the next frame.
  /// \param usable false: the frame counts but may not become the reference
  Step offer(Quality S_total, bool usable = true) {
    Step step;
    ++n_;
    if (usable && S_total.value() > best_) {
      best_ = S_total.value();
      step.new_best = true;
    }
    const bool due = n_ >= thresholds_.frames();
    thresholds_.next(n_, best_);
    if (o_.initial_frame == InitialFrame::FirstPassing && usable && S_total.value() >= th_s()) {
      step.commit = step.new_best = true;
      best_ = S_total.value();
    } else if (due && best_ >= 0 && best_ >= th_s()) {
      step.commit = true;
    } else if (n_ >= o_.frames_max && best_ >= 0 && o_.timeout == InitialTimeout::Degraded) {
      step.commit = step.degraded = true;
    } else if (n_ >= o_.frames_max && o_.timeout == InitialTimeout::Restart) {
      reset();
      step = {};
      step.restarted = true;
    }
    return step;
  }
  [[nodiscard]] int frames() const { return n_; }                      ///< n, frames offered
  [[nodiscard]] double th_f() const { return thresholds_.frames(); }   ///< [frames]
  [[nodiscard]] double th_s() const { return thresholds_.quality(); }  ///< [0,1]
  [[nodiscard]] Quality best() const { return Quality(best_); }        ///< S* (0 when there is none)
  [[nodiscard]] bool has_best() const { return best_ >= 0; }

 private:
  InitialisationOptions o_;
  Thresholds thresholds_;
  int n_ = 0;
  double best_ = -1;
};
using Initialiser = BasicInitialiser<>;

APSO_NAMESPACE_END
