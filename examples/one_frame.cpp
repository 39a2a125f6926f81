// One frame through all equations of the paper, (1) to (17), with its numbers: prints docs/one_frame.md. What is printed comes from
// the run; every equation is computed once more from its parts, and the program fails if that is not what the pipeline says.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include <apso/quality/explain.hpp>
#include <apso/refinement/cost/residuals.hpp>
#include <apso/testing/synthetic_features.hpp>
#include <apso/track.hpp>

namespace {

constexpr int kBadFrame = 44;  // of which only a corner has features, weak ones and 6 px off, as after a fast turn

bool all_agree = true;
/// A number that was computed twice.
double agreed(double computed, double reported, double tolerance = 1e-9) {
  if (!(std::abs(computed - reported) <= tolerance)) {
    std::fprintf(stderr, "one_frame: computed %.9g, reported %.9g\n", computed, reported);
    all_agree = false;
  }
  return reported;
}

/// The people of a frame, as a detector would find them.
std::vector<apso::Detection> detect(const apso::Image<std::uint8_t>& instance) {
  std::vector<apso::Detection> found;
  for (int id = 1; id <= 3; ++id) {
    int left = instance.width(), right = -1, top = instance.height(), bottom = -1;
    for (int y = 0; y < instance.height(); ++y)
      for (int x = 0; x < instance.width(); ++x) {
        if (instance(x, y) != id) continue;
        left = std::min(left, x), right = std::max(right, x), top = std::min(top, y), bottom = std::max(bottom, y);
      }
    if (right - left < 20 || bottom - top < 20) continue;
    apso::Detection d;
    d.box = {static_cast<float>(left), static_cast<float>(top), static_cast<float>(right - left + 1), static_cast<float>(bottom - top + 1)};
    d.score = 0.9F;
    found.push_back(d);
  }
  return found;
}

void print_pose_error(const char* name, const apso::Pose& pose, const apso::Pose& truth) {
  const apso::Pose error = truth.inverse() * pose;
  std::printf("| %s | %.1f | %.2f |\n", name, 1e3 * error.translation().norm(), apso::rotation_angle(error) / apso::kDegree);
}

/// One pixel of a reference, warped into the frame.
struct WarpedPixel {
  double X[3], gamma, reference_intensity, current_intensity, r_I, r_D, squared_w_I, squared_w_D;
};

/// The pixel whose photometric residual is of median size among those that are seen in both images.
WarpedPixel typical_pixel(const apso::PyramidLevel& reference, const apso::PyramidLevel& current, const apso::Pose& T_current_reference,
                          const apso::Illumination& light, const apso::AlignmentOptions& options) {
  const apso::Warper warper(current, T_current_reference, light, options.warp, 1.0F, apso::FramePyramid::background());
  const apso::NoiseModel noise(options.noise);
  const apso::PixelList& pixels = reference.pixels;
  std::vector<WarpedPixel> seen;
  for (int b = 0; b < pixels.blocks(); ++b) {
    for (int at = 0; at < apso::PixelList::kBlock; at += apso::kLanes) {
      apso::WarpedLanes w;
      warper.warp(noise, pixels.block(b), at, w);
      for (int i = 0; i < apso::kLanes; ++i) {
        if (!(w.weight_depth[i] > 0) || !(w.weight_intensity[i] > 0)) continue;
        const auto d = [&](const apso::Lanes& l) { return static_cast<double>(l[i]); };
        seen.push_back({{d(w.X[0]), d(w.X[1]), d(w.X[2])},
                        d(w.weight_intensity),
                        static_cast<double>(pixels.at(b, apso::PixelList::kIntensity, at + i)),
                        d(w.current),
                        d(w.residual_intensity),
                        d(w.residual_depth),
                        d(w.inverse_intensity),
                        d(w.inverse_depth)});
      }
    }
  }
  const auto middle = seen.begin() + static_cast<std::ptrdiff_t>(seen.size() / 2);
  std::nth_element(seen.begin(), middle, seen.end(),
                   [](const WarpedPixel& a, const WarpedPixel& b) { return std::abs(a.r_I) < std::abs(b.r_I); });
  return *middle;
}

void print_scores(const apso::Assessment& a) {
  std::printf(
      "## Can the frame be trusted?\n\n"
      "**(1)** The frame by itself has four scores:\n\n| score | value | weight |\n|---|---|---|\n");
  double sum = 0, weight = 0;
  apso::for_each_frame_score(a, [&](const char* name, const std::optional<double>& v, double w, apso::Better) {
    std::printf("| %s | %.3f | %.2f |\n", name, v.value_or(0), w);
    sum += v ? w * *v : 0;
    weight += v ? w : 0;
  });
  const auto& feature = a.result<apso::Feature>().measured;
  const auto& depth = a.result<apso::Depth>().measured;
  const double S_feature = std::sqrt(feature.S_cnt * feature.S_resp * feature.S_unif) * feature.S_sharp;
  const double S_depth = 0.5 * depth.S_cov + 0.25 * depth.S_cons + 0.25 * depth.S_smo;
  std::printf("\nS_feature = sqrt(S_cnt S_resp S_unif) S_sharp = sqrt(%.3f x %.3f x %.3f) x %.3f = %.3f, of %.0f static keypoints.\n",
              feature.S_cnt, feature.S_resp, feature.S_unif, feature.S_sharp, agreed(S_feature, a.get<apso::Feature>()->value(), 1e-6),
              feature.static_keypoints);
  std::printf("S_depth = 0.5 S_cov + 0.25 S_cons + 0.25 S_smo = 0.5 x %.3f + 0.25 x %.3f + 0.25 x %.3f = %.3f.\n", depth.S_cov,
              depth.S_cons, depth.S_smo, agreed(S_depth, a.get<apso::Depth>()->value(), 1e-6));
  std::printf("\n**(2)** S_total = sum of w S = %.3f. The weights sum to 1.\n", agreed(sum / weight, a.S_total.value()));
}

void print_decision(const apso::Assessment& a, const apso::DecisionOptions& o) {
  std::printf("\n**(7)** The change since the reference, which is %.2f s old, has three:\n\n| score | value | weight |\n|---|---|---|\n",
              a.benchmark_age);
  double sum = 0, weight = 0;
  apso::for_each_change_score(a, [&](const char* name, const std::optional<double>& v, double w, apso::Better) {
    std::printf("| %s | %.3f | %.2f |\n", name, v.value_or(0), w);
    sum += v ? w * *v : 0;
    weight += v ? w : 0;
  });
  const auto& motion = a.result<apso::MotionChange>();
  std::printf("\nS_mc = 1 - overlap exp(-flow / s_m) with an overlap of %.3f and a flow of %.3f image diagonals.\n",
              motion.measured.overlap, motion.measured.flow);
  std::printf("S_change = sum of w S = %.3f.\n", agreed(sum / weight, a.S_change->value()));
  const double base = apso::base_weight(o.w_base, a.dynamic_ratio, o.a);
  std::printf("\n**(8)** W_base = max(0, W - a Dynamic_ratio) = max(0, %.2f - %.2f x %.3f) = %.3f.\n", o.w_base, o.a, a.dynamic_ratio,
              agreed(a.scenario_dynamic ? std::min(base, o.w_dyn) : base, a.W_base));
  std::printf("\n**(9)** W_change = 1 - W_base = %.3f.\n", agreed(1 - a.W_base, a.W_change));
  apso::Quality S = apso::combine_final(a.S_total, a.S_change, a.W_base);
  std::printf("\n**(6)** S_final = W_base S_total + W_change (1 - S_change) = %.3f x %.3f + %.3f x (1 - %.3f) = %.3f", a.W_base,
              a.S_total.value(), a.W_change, a.S_change->value(), S.value());
  if (a.scenario_static) S = apso::boost(S, o.boost_static);
  if (a.scenario_objects) {
    S = apso::boost(S, o.boost_object);
    std::printf(".\nThe detections are confident, so that it is raised to S + b (1 - S) with b = %.2f: %.3f", o.boost_object, S.value());
  }
  if (a.S_inn.value() < 1) {
    S = apso::Quality(S.value() * a.S_inn.value());
    std::printf(
        ".\nThe feature pose lies %.1f mm off the prediction, more than is typical here, so that it is multiplied by S_inn = %.3f: %.3f",
        1e3 * a.innovation, a.S_inn.value(), S.value());
  }
  agreed(S.value(), a.S_final->value());
  std::printf(".\n\n**(11)** %.3f is less than th_differ = %.2f: the frame is **%s**. The library says:\n\n", a.S_final->value(),
              a.th_differ, to_string(a.state));
  const std::string words = apso::explain(a);  // one line of the page for each part
  for (std::size_t from = 0; from != std::string::npos;) {
    const std::size_t to = words.find("; ", from);
    std::printf("    %s\n", words.substr(from, to == std::string::npos ? to : to + 1 - from).c_str());
    from = to == std::string::npos ? to : to + 2;
  }
  std::printf(
      "\n**(10)** The reference has S_Initial = %.3f. A BAD frame does not take its place, whatever its S_total: this one has %.3f.\n",
      a.S_reference, a.S_total.value());
}

}  // namespace

int main() {
  const apso::testing::SyntheticSequence room("walking_xyz");
  const apso::Pinhole camera = room.camera();
  apso::testing::SyntheticFeatures found(camera);  // in place of a corner detector
  apso::testing::SyntheticFrame image;             // in place of a camera
  const apso::PipelineOptions options;
  apso::LandmarkTracker tracker(camera);
  apso::Pipeline pipeline(camera, options);
  apso::Assessment first;  // of the frame with which the search for a reference ends
  for (int i = 0;; ++i) {
    room.render(i, image);
    found.find(image);
    std::vector<apso::Keypoint> keypoints = found.keypoints();
    auto descriptors = found.descriptors();
    auto tracks = found.tracks();
    for (apso::Keypoint& k : keypoints) k.response = i == kBadFrame ? 20 : 40;
    if (i == kBadFrame) {  // only those at the left remain, and not where they should be
      std::size_t kept = 0;
      for (std::size_t k = 0; k < keypoints.size(); ++k) {
        if (keypoints[k].x > 150 || keypoints[k].y > 200) continue;
        keypoints[kept] = keypoints[k];
        keypoints[kept].x += 6;
        tracks[kept] = tracks[k];
        tracks[kept].x += 6;
        descriptors[kept++] = descriptors[k];
      }
      keypoints.resize(kept);
      tracks.resize(kept);
      descriptors.resize(kept);
    }
    const auto now = apso::frame(image.timestamp, image.intensity, image.depth, camera);
    const std::vector<apso::Detection> people = detect(image.instance);
    tracker.begin(now, keypoints, descriptors, tracks);
    const auto prior = tracker.estimate(pipeline.observation().mask.probability);
    const auto& seen = pipeline.observe(now, prior.T_world_camera, tracks, people);
    const auto pose = tracker.estimate(seen.mask.probability);
    pipeline.assess(keypoints, tracks, {pose.T_world_camera, pose.T_world_predicted, pose.ok, pose.information});
    const apso::ReferenceMemory memory = pipeline.refiner().memory();  // as it is before this frame
    const auto& report = pipeline.conclude();
    tracker.commit(report.T_world_camera, seen.mask.probability, report.keyframe_allowed);
    if (report.state == apso::SceneState::Initialising) first = report.assessment;
    if (i < kBadFrame) continue;

    const apso::Assessment& a = report.assessment;
    const apso::Refinement& r = report.refinement;
    std::printf(
        "# One frame through all equations\n\n"
        "Frame %d of `synthetic:walking_xyz`: two people walk, and of the features only %zu in one corner are left, weak ones and 6 px "
        "off, as\n"
        "after a fast turn. All numbers are those of this frame; `build/bin/one_frame` computes them, each equation once more from its "
        "parts,\n"
        "and prints this page. What each equation is, and where the default differs from the print, is in [Equations](equations.md). "
        "Numbers\n"
        "are rounded in print.\n\n"
        "## The reference\n\n",
        i, keypoints.size());
    const apso::InitialisationOptions& start = options.assessor.initialisation;
    std::printf("**(4)** After %d frames the window closes: th_f = %.0f frames.\n\n", first.frame, first.th_f);
    std::printf("**(5)** Until then a reference needs th_s = max(%.2f, %.2f (1 - %.1f log(max(1, %d / %.0f)))) = %.3f.\n\n",
                start.quality_min, start.quality, start.decay, first.frame, start.frames,
                agreed(apso::quality_threshold(first.frame, start), first.th_s));
    std::printf(
        "**(3)** The best frame of the window passes it and becomes the reference. Since then the reference was replaced or handed\non as "
        "the camera moved; the present one has S_total = %.3f.\n\n",
        a.S_reference);
    print_scores(a);
    print_decision(a, options.assessor.decision);

    // Refinement: which references, how they weigh, and what one pixel of the nearest one says.
    apso::DepthDescriber describe;
    const apso::DepthGrid grid = describe(now.depth(), seen.mask.probability, options.refiner.pyramid.depth);
    struct Near {
      double depth, motion, distance;
      const apso::ReferenceMemory::Entry* entry;
    };
    std::vector<Near> near;
    for (int k = 0; k < memory.size(); ++k) {
      const auto& e = memory.entry(k);
      const auto d = apso::grid_distance(grid, e.descriptor.depth);
      if (!d) continue;
      const double m = apso::motion_distance(e.T_world_reference, report.T_world_feature);
      near.push_back({*d, m, apso::reference_distance(*d, m), &e});
    }
    std::sort(near.begin(), near.end(), [](const Near& x, const Near& y) { return x.distance < y.distance; });
    const apso::MemoryOptions& mem = options.refiner.memory;
    std::printf(
        "\n## Where is the camera really?\n\n"
        "**(12)** Of the %d good frames in memory, those at a distance of at most th = %.1f are references, the %d nearest of them. D is "
        "the\n"
        "difference of the depth grids, in units of 0.1 / m, M that of the poses, in units of 0.15 m and 10 degrees:\n\n"
        "| good frame | D | M | distance, sqrt(D^2 + M^2) | | age [s] | B |\n|---|---|---|---|---|---|---|\n",
        memory.size(), mem.th_keyframes, mem.most_references());
    agreed(near.front().distance, r.reference_distance, 1e-6);
    for (std::size_t k = 0; k < 3 && k < near.size(); ++k) {
      const double age = image.timestamp - near[k].entry->timestamp;
      std::printf("| %zu | %.3f | %.3f | %.3f | %s | %.2f | %.3f |\n", k + 1, near[k].depth / 0.1, near[k].motion, near[k].distance,
                  near[k].distance <= mem.th_keyframes ? "reference" : "too far", age,
                  apso::time_decay(image.timestamp, near[k].entry->timestamp, mem.decay));
    }
    std::printf(
        "\nB = exp(-lambda |t_c - t_k|) with lambda = %.1f / s is the weight of each in **(16)**. The frame before is one more, with %.1f "
        "times\n"
        "its B.\n\n",
        mem.decay, apso::kPreviousWeight);

    apso::FramePyramid current;
    current.build(now, camera, seen.mask.probability, options.refiner.pyramid, apso::PyramidRole::Current);
    const apso::ReferenceMemory::Entry& nearest = *near.front().entry;
    const apso::AlignmentOptions& align = options.refiner.alignment;
    const int finest = std::max(nearest.pyramid.finest(), current.finest());
    const WarpedPixel p = typical_pixel(nearest.pyramid.halved(finest), current.halved(finest),
                                        apso::inverse(r.T_world_direct) * nearest.T_world_reference, r.alignment.illumination, align);
    const auto& light = r.alignment.illumination;
    const auto gain = static_cast<double>(light.gain);
    const auto offset = static_cast<double>(light.offset);
    std::printf(
        "One pixel of the first reference, the one whose |r_I| is the median: the point X = (%.3f, %.3f, %.3f) m.\n\n"
        "**(13)** r_I = I_B(W(x)) - (g I_A(x) + o) = %.4f - (%.3f x %.4f %+.4f) = %.4f, with the brightness g, o that is estimated.\n\n"
        "**(14)** r_D = D_B(W(x)) - z = %.1f mm.\n\n",
        p.X[0], p.X[1], p.X[2], p.current_intensity, gain, p.reference_intensity, offset,
        agreed(p.current_intensity - (gain * p.reference_intensity + offset), p.r_I, 1e-5), 1e3 * p.r_D);
    const double w_I = std::sqrt(p.squared_w_I);
    const double w_D = std::sqrt(p.squared_w_D);
    const double s_I = w_I * p.r_I / r.alignment.scale_intensity;
    const double s_D = w_D * p.r_D / r.alignment.scale_depth;
    const apso::KernelRef C(align.kernel);
    const double cost = align.alpha * align.alpha * C.rho(s_I) + C.rho(s_D);
    std::printf(
        "**(15)** By the noise of the sensor w_I = %.1f and w_D = %.1f / m; the scales of all residuals are %.3f and %.3f, alpha_I = %.0f. "
        "With\n"
        "s_I = w_I r_I / %.3f = %.3f, s_D = w_D r_D / %.3f = %.3f and Cauchy's C: D = alpha_I^2 C(s_I) + C(s_D) = %.4f.\n\n",
        w_I, w_D, r.alignment.scale_intensity, r.alignment.scale_depth, align.alpha, r.alignment.scale_intensity, s_I,
        r.alignment.scale_depth, s_D, cost);
    const double B = apso::time_decay(image.timestamp, nearest.timestamp, mem.decay);
    std::printf(
        "**(16)** It adds B gamma D = %.3f x %.3f x %.4f = %.4f to the sum. The pose with the least sum over %d pixels\n"
        "of the finest level and %d references, found after %d iterations, is the direct pose. It is known well\n"
        "enough to be believed with c_dir = %.3f.\n\n",
        B, p.gamma, cost, B * p.gamma * cost, r.alignment.counts.selected, r.references, r.alignment.iterations, r.c_dir);
    const double w_diff = std::exp(-options.refiner.blend.mu * a.S_change->value());
    std::printf(
        "**(17)** w_diff = exp(-mu S_change) = exp(-%.0f x %.3f) = %.3f would be the weight of the feature pose as printed. By default "
        "each pose\n"
        "weighs by its information in each direction, S_final F against c_dir D: the final position is %.1f %% of the way from the direct "
        "to the\n"
        "feature position%s.\n\n",
        options.refiner.blend.mu, a.S_change->value(), agreed(w_diff, r.w_diff), 100 * r.w_eff,
        r.gated ? ", since they are too far apart to be averaged" : "");
    const apso::Pose truth = room.T_world_camera(0).inverse() * room.T_world_camera(i);
    std::printf("| pose | error [mm] | error [degrees] |\n|---|---|---|\n");
    print_pose_error("T_feature", report.T_world_feature, truth);
    print_pose_error("T_direct", report.T_world_direct, truth);
    print_pose_error("T_final", report.T_world_camera, truth);
    const bool repaired = report.state == apso::SceneState::Bad && r.refined;
    return all_agree && repaired ? 0 : 1;
  }
}
