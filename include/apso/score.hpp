/// \file
/// Front door: how good is a frame, and why? The scores of one frame, alone or together.
///
/// Images, keypoints, tracks and detections are of any type with traits (docs/concepts); no image is copied, and nothing is
/// kept after the call. The shortest complete use:
/// \code
///   #include <apso/score.hpp>
///   apso::SceneAssessor assessor(camera);
///   const auto now = apso::frame(timestamp, grey, apso::scaled(depth, 0.001F), camera);  // 16-bit millimetres, as they are
///   const auto& a = assessor.assess(apso::assessment_input(now, keypoints, tracks, detections, dynamic_probability));
///   if (a.state == apso::SceneState::Bad) log(apso::explain(a));                          // one sentence
/// \endcode
/// `apso::none` stands for what you do not have; its scores are then missing and leave their weight to the others.
///
/// | question                              | answer                                                                  |
/// |---------------------------------------|-------------------------------------------------------------------------|
/// | how good is the frame by itself?      | `a.S_total`                                                             |
/// | one score                             | `a.get<Feature>()`, `a.get("S_feature")`                                |
/// | what was it computed from?            | `a.result<Feature>().measured`                                          |
/// | all scores, e.g. for a table          | `for_each_score(a, f)`, `for_each_measurement(a, f)`                    |
/// | has the scene changed?                | `a.S_change`, missing as long as there is no other frame                |
/// | can the frame be trusted?             | `a.state`, once a reference is found (threshold.hpp)                    |
/// | one score without an assessor         | `depth_score(depth)`, `confidence_score(...)`, `measure_features(...)` ... |
/// | a score of my own                     | one struct and one entry in a list: score_list.hpp, docs/quality.md     |
///
/// The first frames look for a reference: their state is Initialising. Images of another size than the camera are a
/// contract_error. A Quality is better when higher, a Deviation when lower, both in [0,1].
#pragma once

#include <apso/quality/assessor.hpp>
#include <apso/quality/explain.hpp>
#include <apso/quality/scores/confidence.hpp>
#include <apso/quality/scores/depth.hpp>
#include <apso/quality/scores/feature.hpp>
#include <apso/quality/scores/sharpness.hpp>
#include <apso/quality/scores/spatial.hpp>
#include <apso/traits/frame.hpp>
