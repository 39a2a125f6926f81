/// \file
/// Every motion policy by its name, those of the core and the detectors that need OpenCV.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/io/detection_text.hpp>
#include <apso/observation/motion_by_name.hpp>
#include <apso/observation/policy_expression.hpp>
#include <apso/opencv/detectors/detector_policy.hpp>
#include <apso/opencv/detectors/dnn_detector.hpp>
#include <apso/opencv/detectors/hog_people.hpp>
#include <apso/opencv/detectors/precomputed_motion.hpp>
#include <apso/options.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

/// Options of all policies, by name.
struct MotionOptions : apso::MotionOptions {
  HogPeopleOptions hog_people;
  DnnOptions dnn;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    apso::MotionOptions::fields(s, v);
    v("hog_people", s.hog_people);
    v("dnn", s.dnn);
  }
};

/// What a policy may need from outside.
struct MotionFiles {
  std::string masks;       ///< folder of mask images, for `precomputed`
  std::string detections;  ///< file or folder of detections, for `precomputed`
  std::string model;       ///< ONNX file, for `dnn`
  ClassList classes;       ///< of the detections and of the network
  FileUse* use = nullptr;  ///< counts what `precomputed` could use, and must outlive it; may be null
};

/// All policies. Camera, options and files must outlive the table; the files are opened when a policy is made.
[[nodiscard]] inline PolicyTable motion_table(const Pinhole& camera, const MotionOptions& options, const MotionFiles& files) {
  PolicyTable t = apso::motion_table(camera, options);
  const bool has_files = !files.masks.empty() || !files.detections.empty();
  const auto hog = [&] { return DetectorPolicy<HogPeople>(HogPeople(options.hog_people)); };
  const auto dnn = [&] {
    if (files.model.empty()) contract_violation("motion policy 'dnn' needs the file of a network");
    return DetectorPolicy<DnnDetector>(DnnDetector(files.model, options.dnn, files.classes));
  };
  const auto precomputed = [&camera, &files, has_files] {
    if (!has_files) contract_violation("motion policy 'precomputed' needs a folder of masks, or detections");
    return PrecomputedMotion(camera, files.masks, files.detections, files.classes, files.use);
  };
  t.emplace_back("hog-people", hog, "people by gradients");
  t.emplace_back("dnn", dnn, "objects of a network, needs --model");
  t.emplace_back("precomputed", precomputed, "files of another program, needs --masks or --detections");
  t.emplace_back(
      "semantic",
      [=, &files]() -> AnyMotionPolicy {
        if (!files.model.empty()) return dnn();
        if (has_files) return precomputed();
        return hog();
      },
      "dnn, precomputed or hog-people, the first that has its files");
  return t;
}

/// The policy that an expression such as "geometric", "depth-refined-mask(hog-people) | geometric" or "semantic & geometric"
/// describes; see policy_expression.hpp.
/// \param own policies of yours by name; they come before those of apso
/// Throws contract_error for an expression or name that is wrong, io_error for files that cannot be used.
[[nodiscard]] inline AnyMotionPolicy motion_by_name(const std::string& expression, const Pinhole& camera, const MotionOptions& options = {},
                                                    const MotionFiles& files = {}, PolicyTable own = {}) {
  for (NamedPolicy& entry : motion_table(camera, options, files)) own.push_back(std::move(entry));
  return parse_policy(expression, own);
}

}  // namespace opencv
APSO_NAMESPACE_END
