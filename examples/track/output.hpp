/// \file
/// What apso_track writes: frames.csv while it runs, the trajectories and summary.json at the end.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <apso/evaluation/ate.hpp>
#include <apso/evaluation/rpe.hpp>
#include <apso/evaluation/trajectory.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/pipeline/pipeline.hpp>
#include <apso/quality/explain.hpp>

#include "results.hpp"

namespace track {

/// Wall-clock time of each stage of one frame [ms].
struct Timing {
  double load = 0;
  double features = 0;  ///< keypoints, tracks, both pose estimates
  double observe = 0;
  double assess = 0;
  double refine = 0;  ///< refinement of BAD frames, memory of all
  double map = 0;     ///< keyframes and landmarks
  double wall = 0;    ///< from frame to frame, with waiting for the images and with pictures
  [[nodiscard]] double total() const { return features + observe + assess + refine + map; }  ///< without loading
};

/// Milliseconds since the last call.
class Stopwatch {
 public:
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double ms = std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
    return ms;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// One row per frame; an absent score is an empty field.
class FrameTable {
 public:
  explicit FrameTable(std::string file) : file_(std::move(file)), stream_(file_) {
    stream_ << "frame,timestamp,state,label,";
    const auto name_column = [this](const std::string& name, auto&&...) { stream_ << name << ','; };
    apso::for_each_frame_score(apso::Assessment{}, name_column);
    stream_ << "S_total,";
    apso::for_each_change_score(apso::Assessment{}, name_column);
    stream_ << "S_change,S_step,dynamic_ratio,innovation,S_inn,"
               "W_base,W_change,S_final,th_differ,th_f,th_s,degraded,benchmark_updated,benchmark_age_s,"
               "objects,feature_ok,feature_matches,feature_inliers,keyframes,landmarks,part,refined,refine_status,w_diff,w_eff,"
               "c_dir,references,far_reference,gated,pose_source,valid_share,scale_intensity,scale_depth,degenerate_directions,"
               "iterations,ms_load,ms_features,ms_observe,ms_assess,ms_refine,ms_map,ms_total,";
    apso::for_each_measurement(apso::Assessment{}, name_column);
    stream_ << "explanation\n";
    flush();
  }

  template <class FeatureResult>
  void write(int frame, const std::string& label, const apso::FrameReport& r, const apso::Observation& seen, const FeatureResult& features,
             int keyframes, int landmarks, int part, const Timing& ms) {
    const apso::Assessment& a = r.assessment;
    first_ = true;
    put(frame);
    char stamp[32];
    std::snprintf(stamp, sizeof stamp, "%.6f", r.timestamp);
    text(stamp);
    text(to_string(r.state));
    text(label);
    const auto put_score = [this](const char*, const std::optional<double>& value, double, apso::Better) {
      optional(value.has_value(), value.value_or(0.0));
    };
    apso::for_each_frame_score(a, put_score);
    put(a.S_total.value());
    apso::for_each_change_score(a, put_score);
    score(a.S_change);
    score(a.S_step);
    put(a.dynamic_ratio);
    optional(std::isfinite(a.innovation), a.innovation);
    put(a.S_inn.value());
    put(a.W_base);
    put(a.W_change);
    score(a.S_final);
    put(a.th_differ);
    put(a.th_f);
    put(a.th_s);
    put(a.degraded ? 1 : 0);
    put(a.benchmark_updated ? 1 : 0);
    put(a.benchmark_age);
    put(static_cast<double>(seen.objects.size()));
    put(features.ok ? 1 : 0);
    put(features.matches);
    put(features.inliers);
    put(keyframes);
    put(landmarks);
    put(part);
    put(r.refined ? 1 : 0);
    const bool tried = r.refinement.status != apso::Status::NotRun;
    const apso::Refinement& d = r.refinement;
    text(tried ? to_string(d.status) : "");
    optional(tried, d.w_diff);
    optional(tried, d.w_eff);
    optional(tried, d.c_dir);
    optional(tried, d.references);
    optional(tried, d.far_reference ? 1 : 0);
    optional(tried, d.gated ? 1 : 0);
    text(to_string(r.source));
    optional(tried, d.alignment.valid_share);
    optional(tried, d.alignment.scale_intensity);
    optional(tried, d.alignment.scale_depth);
    optional(tried, d.alignment.degenerate_count);
    optional(tried, d.alignment.iterations);
    for (double v : {ms.load, ms.features, ms.observe, ms.assess, ms.refine, ms.map, ms.total()}) put(v);
    apso::for_each_measurement(a, [this](const std::string&, double value) { put(value); });
    text("\"" + explain(a) + "\"");
    stream_ << '\n';
    flush();  // what is computed is kept, whatever happens next
  }

 private:
  void flush() {
    stream_.flush();
    if (!stream_) throw cannot_write(file_);
  }
  void text(const std::string& s) {
    if (!first_) stream_ << ',';
    first_ = false;
    stream_ << s;
  }
  void put(double v) {
    char number[32];
    std::snprintf(number, sizeof number, "%.6g", v);
    text(std::isfinite(v) ? number : "");
  }
  void optional(bool present, double v) { present ? put(v) : text(""); }
  template <class Maybe>
  void score(const Maybe& s) {
    optional(s.has_value(), s ? s->value() : 0.0);
  }

  std::string file_;
  std::ofstream stream_;
  bool first_ = true;
};

inline nlohmann::json to_json(const apso::Statistics& s) {
  return {{"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median}, {"std", s.std}, {"min", s.min}, {"max", s.max}};
}

/// Median, 95th percentile and largest of some values.
inline nlohmann::json distribution(std::vector<double> v) {
  if (v.empty()) return nullptr;
  std::sort(v.begin(), v.end());
  const auto at = [&](double q) { return v[static_cast<std::size_t>(q * static_cast<double>(v.size() - 1))]; };
  return {{"median", at(0.5)}, {"p95", at(0.95)}, {"max", v.back()}};
}

}  // namespace track
