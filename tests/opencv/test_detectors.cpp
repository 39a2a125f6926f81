// Detectors, end to end: tiny networks with hand-set weights, people by gradients, files of another program.
#include <doctest/doctest.h>

#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/io/detection_text.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/opencv/detectors/detector_policy.hpp>
#include <apso/opencv/detectors/dnn_detector.hpp>
#include <apso/opencv/detectors/hog_people.hpp>
#include <apso/opencv/detectors/motion_by_name.hpp>
#include <apso/opencv/detectors/precomputed_motion.hpp>
#include <apso/opencv/mask_image.hpp>
#include <apso/testing/synthetic.hpp>

namespace {
using namespace apso;
namespace fs = std::filesystem;

struct Folder {
  fs::path path;
  explicit Folder(const char* name) : path(fs::temp_directory_path() / (std::string("apso_") + name + std::to_string(::getpid()))) {
    fs::remove_all(path);
    fs::create_directories(path);
  }
  ~Folder() { fs::remove_all(path); }
  std::string write(const char* name, const std::string& content) const {
    std::ofstream(path / name) << content;
    return (path / name).string();
  }
};

#ifdef APSO_TINY_MODELS
std::string model(const char* name) { return std::string(APSO_TINY_MODELS) + "/tiny_" + name + ".onnx"; }

/// A grey picture with red and blue squares.
struct Picture {
  cv::Mat_<cv::Vec3b> bgr;
  Image<float> depth;
  Picture(int width, int height) : bgr(height, width, cv::Vec3b(128, 128, 128)), depth(width, height, 2.0F) {}
  Picture& square(int x, int y, int side, bool red) {
    cv::rectangle(bgr, cv::Rect(x, y, side, side), red ? cv::Scalar(0, 0, 255) : cv::Scalar(255, 0, 0), cv::FILLED);
    return *this;
  }
  [[nodiscard]] RgbdFrame frame() const { return {0, depth, depth, {reinterpret_cast<const Bgr8*>(bgr[0]), bgr.cols, bgr.rows}}; }
};

opencv::DnnOptions small_input() {
  opencv::DnnOptions o;
  o.input_width = o.input_height = 64;
  return o;
}
ClassList two_classes() {
  ClassList c;
  c.names = {"red", "blue"};
  c.movable = {0};
  return c;
}

TEST_CASE("dnn: boxes, classes and scores of the YOLO heads, in the pixels of the image") {
  for (const char* kind : {"yolov8", "yolov5", "yolov8_seg"}) {
    CAPTURE(kind);
    // the image is twice the input in width, so it is scaled by 1/2 and padded by 16 rows above and below
    Picture p(128, 64);
    p.square(32, 16, 48, true);  // in the input: centre (28, 36), side 24, just what one cell looks at
    p.square(88, 16, 36, false);
    opencv::DnnDetector detector(model(kind), small_input(), two_classes());
    const auto& found = detector.detect(p.frame());
    REQUIRE(found.size() == 1);  // the blue square is smaller than the window: too weak
    CHECK(found[0].class_id == 0);
    CHECK(found[0].movable);
    CHECK(found[0].score > 0.9F);
    CHECK(iou(found[0].box, Box{32, 16, 48, 48}) > 0.99F);
    Picture q(64, 64);
    q.square(8, 8, 24, true).square(32, 32, 24, false);
    const auto& both = detector.detect(q.frame());
    REQUIRE(both.size() == 2);
    for (const Detection& d : both) {
      CHECK(d.movable == (d.class_id == 0));
      CHECK(iou(d.box, d.class_id == 0 ? Box{8, 8, 24, 24} : Box{32, 32, 24, 24}) == doctest::Approx(1.0));
      // the window is exactly filled: mean 1, logit 24 (1 - 0.8)
      CHECK(d.score == doctest::Approx(1.0 / (1.0 + std::exp(-4.8))).epsilon(1e-3));
    }
    CHECK(detector.detect(Picture(64, 64).frame()).empty());
  }
}

TEST_CASE("dnn: thresholds of score and overlap") {
  Picture q(64, 64);
  q.square(8, 8, 24, true);
  opencv::DnnOptions options = small_input();
  options.score = 0.03F;  // the four neighbouring cells see 2/3 of the square: logit 24 (2/3 - 0.8) = -3.2
  options.nms = 0.6F;     // their boxes overlap by IoU 1/2
  CHECK(opencv::DnnDetector(model("yolov8"), options, two_classes()).detect(q.frame()).size() == 5);
  options.nms = 0.4F;
  CHECK(opencv::DnnDetector(model("yolov8"), options, two_classes()).detect(q.frame()).size() == 1);
  options.score = 0.995F;
  CHECK(opencv::DnnDetector(model("yolov8"), options, two_classes()).detect(q.frame()).empty());
}

TEST_CASE("dnn: masks of prototypes follow the object, not the box") {
  Picture p(128, 64);
  p.square(32, 16, 48, true);
  // the lower right of the square is grey: not part of the red object
  cv::rectangle(p.bgr, cv::Rect(64, 48, 16, 16), cv::Scalar(128, 128, 128), cv::FILLED);
  opencv::DnnOptions options = small_input();
  options.score = 0.2F;
  opencv::DnnDetector detector(model("yolov8_seg"), options, two_classes());
  const auto& found = detector.detect(p.frame());
  REQUIRE(found.size() == 1);
  REQUIRE_FALSE(found[0].mask.empty());
  REQUIRE(found[0].mask.width == 128);
  CHECK(found[0].mask(48, 24) != 0);
  CHECK(found[0].mask(36, 58) != 0);
  CHECK(found[0].mask(74, 58) == 0);
  CHECK(found[0].mask(100, 32) == 0);
}

TEST_CASE("dnn: Mask R-CNN outputs, with masks stretched over their boxes") {
  Picture p(64, 64);
  p.square(16, 24, 24, true);
  opencv::DnnOptions options = small_input();
  options.first_class = 1;
  opencv::DnnDetector detector(model("mask_rcnn"), options, two_classes());
  const auto& found = detector.detect(p.frame());
  REQUIRE(found.size() == 1);
  CHECK(found[0].class_id == 0);
  CHECK(iou(found[0].box, Box{16, 24, 24, 24}) == doctest::Approx(1.0));
  REQUIRE_FALSE(found[0].mask.empty());
  CHECK(found[0].mask(20, 36) != 0);  // the hand-set masks fill the left half
  CHECK(found[0].mask(36, 36) == 0);
  CHECK(found[0].mask(14, 36) == 0);
}

TEST_CASE("dnn: as a policy it marks movable objects and knows nothing of the rest") {
  Picture q(64, 64);
  q.square(8, 8, 24, true).square(32, 32, 24, false);
  opencv::DetectorPolicy<opencv::DnnDetector> policy(opencv::DnnDetector(model("yolov8"), small_input(), two_classes()));
  CHECK(is_motion_policy_v<decltype(policy)>);
  DynamicMask m;
  policy.observe(q.frame(), Pose::Identity(), {}, m);
  CHECK(m.probability(20, 20) > 0.95F);
  CHECK(m.known(20, 20) == 1);
  CHECK(m.probability(44, 44) == 0.0F);
  CHECK(m.known(2, 60) == 0);
  CHECK(policy.detections().size() == 2);
}

TEST_CASE("dnn: what cannot be used says so") {
  const auto message = [](const auto& act) -> std::string {
    try {
      act();
    } catch (const io_error& e) {
      return e.what();
    }
    return {};
  };
  Picture p(64, 64);
  const std::string other = message([&] { opencv::DnnDetector(model("classifier"), small_input()).detect(p.frame()); });
  CHECK(other.find("tiny_classifier.onnx") != std::string::npos);
  CHECK(other.find("'classes' 1x2") != std::string::npos);
  CHECK(other.find("Mask R-CNN") != std::string::npos);
  CHECK(other.find("precomputed") != std::string::npos);
  const Folder f("dnn");
  const std::string broken = message([&] { opencv::DnnDetector(f.write("x.onnx", "not a network")); });
  CHECK(broken.find("x.onnx: cannot be read as an ONNX network") != std::string::npos);
  CHECK_FALSE(message([&] { opencv::DnnDetector("/no/such.onnx"); }).empty());
  opencv::DnnOptions wrong = small_input();
  wrong.input_width = 40;
  CHECK(message([&] { opencv::DnnDetector(model("yolov8"), wrong).detect(p.frame()); }).find("40x64") != std::string::npos);
}
#endif

TEST_CASE("outputs: the forms that no tiny network has") {
  // YOLOv10: corners, score, class
  float end[300 * 6] = {};
  const float row[6] = {10, 20, 40, 80, 0.9F, 7};
  std::copy(row, row + 6, end + 6 * 5);
  const int shape[3] = {1, 300, 6};
  auto found = opencv::decode({"out"}, {cv::Mat(3, shape, CV_32F, end)}, opencv::NetworkHead::Auto, 640, 640, 0.5F);
  REQUIRE(found.objects.size() == 1);
  CHECK(found.objects[0].class_id == 7);
  CHECK(found.objects[0].box.width == 30);
  CHECK(found.objects[0].box.height == 60);
  // 1 x 1 x N x 7 with a mask per class
  float rows[14] = {0, 1, 0.8F, 0.25F, 0.5F, 0.5F, 0.75F, 0, 1, 0.1F, 0, 0, 1, 1};
  float masks[2 * 2 * 2 * 2] = {};
  masks[1 * 4 + 0] = masks[1 * 4 + 2] = 1;  // object 0, class 1: the left column
  const int rows_shape[4] = {1, 1, 2, 7};
  const int masks_shape[4] = {2, 2, 2, 2};
  found = opencv::decode({"detection_out_final", "detection_masks"},
                         {cv::Mat(4, rows_shape, CV_32F, rows), cv::Mat(4, masks_shape, CV_32F, masks)}, opencv::NetworkHead::Auto, 100,
                         200, 0.5F);
  REQUIRE(found.objects.size() == 1);
  CHECK(found.objects[0].box.x == doctest::Approx(25));
  CHECK(found.objects[0].box.height == doctest::Approx(50));
  Image<std::uint8_t> mask;
  REQUIRE(opencv::mask_of(found, found.objects[0], opencv::Letterbox::fit(100, 200, 100, 200), 100, 200, mask));
  CHECK(mask(28, 125) == 255);
  CHECK(mask(47, 125) == 0);
  CHECK(mask(10, 125) == 0);
}

TEST_CASE("fuzz: fewer masks than rows of objects are refused, not read beyond their end") {
  float rows[14] = {0, 1, 0.8F, 0.25F, 0.5F, 0.5F, 0.75F, 0, 1, 0.9F, 0, 0, 1, 1};
  float masks[4] = {};
  const int rows_shape[4] = {1, 1, 2, 7};
  const int masks_shape[4] = {1, 1, 2, 2};
  const std::vector<cv::Mat> outputs{cv::Mat(4, rows_shape, CV_32F, rows), cv::Mat(4, masks_shape, CV_32F, masks)};
  CHECK_THROWS_AS(opencv::decode({"rows", "masks"}, outputs, opencv::NetworkHead::Auto, 100, 200, 0.5F), io_error);
}

TEST_CASE("fuzz: the mask of a box that is thinner than any pixel is that of its border") {
  float ones[4] = {1, 1, 0, 0};  // the upper row
  const int shape[4] = {1, 1, 2, 2};
  opencv::NetworkObjects found;
  found.masks = cv::Mat(4, shape, CV_32F, ones);
  opencv::NetworkObject o;
  o.mask = 0;
  Image<std::uint8_t> mask;
  for (const float thin : {1e-3F, 1e-9F, 1e-20F, 1e-38F}) {
    for (const float at : {10.2F, 10.8F}) {  // the middle of the pixel is far to the right of the box, or to the left
      o.box = {at, 20, thin, 2};
      REQUIRE(opencv::mask_of(found, o, opencv::Letterbox::fit(64, 48, 64, 48), 64, 48, mask));
      CHECK(mask(10, 20) == 255);
      CHECK(mask(10, 21) == 0);
      o.box = {10, at, 2, thin};
      REQUIRE(opencv::mask_of(found, o, opencv::Letterbox::fit(64, 48, 64, 48), 64, 48, mask));
      CHECK(mask(10, 10) == (at < 10.5F ? 0 : 255));
      CHECK(mask(11, 10) == mask(10, 10));
    }
  }
}

TEST_CASE("hog-people: finds walking people of the synthetic room, and none without people") {
  opencv::DetectorPolicy<opencv::HogPeople> policy{opencv::HogPeople{}};
  testing::SyntheticOptions options;
  options.seed = 5;
  const testing::SyntheticSequence walking("walking_static", options);
  const testing::SyntheticSequence empty("static_static", options);
  testing::SyntheticFrame f;
  DynamicMask m;
  int hits = 0, misses = 0, wrong = 0;
  for (int i = 40; i < 100; i += 6) {
    walking.render(i, f);
    policy.observe(f.rgbd(), f.T_world_camera, {}, m);
    for (const Detection& d : policy.detections()) {
      double on = 0, all = 0;  // of the pixels of the box in the image, those of people
      for (int y = std::max(0, static_cast<int>(d.box.y)); y < std::min(480, static_cast<int>(d.box.y + d.box.height)); ++y) {
        for (int x = std::max(0, static_cast<int>(d.box.x)); x < std::min(640, static_cast<int>(d.box.x + d.box.width)); ++x) {
          on += f.instance(x, y) != 0 ? 1 : 0;
          all += 1;
        }
      }
      (on > 0.25 * all ? hits : misses) += 1;
    }
    if (!policy.detections().empty()) CHECK(dynamic_ratio(m) > 0.02);
    empty.render(i, f);
    policy.observe(f.rgbd(), f.T_world_camera, {}, m);
    wrong += static_cast<int>(policy.detections().size());
  }
  CHECK(hits >= 5);  // of ten images with two people each; both are cut by the edge of most
  CHECK(misses <= hits / 2);
  CHECK(wrong <= 2);
}

TEST_CASE("detections in text: YOLO's shares of the image, and pairs of name and pixel") {
  const Folder f("text");
  const auto yolo = read_detections(f.write("a.txt", "0 0.5 0.5 0.25 0.5 0.875\n# comment\n\n56 0.1 0.2 0.2 0.4\n"), 640, 480);
  REQUIRE(yolo.size() == 2);
  CHECK(yolo[0].box.x == doctest::Approx(240));
  CHECK(yolo[0].box.y == doctest::Approx(120));
  CHECK(yolo[0].box.width == doctest::Approx(160));
  CHECK(yolo[0].box.height == doctest::Approx(240));
  CHECK(yolo[0].score == 0.875F);
  CHECK(yolo[0].movable);
  CHECK(yolo[1].class_id == 56);
  CHECK(yolo[1].score == 1.0F);
  CHECK_FALSE(yolo[1].movable);
  const auto pairs =
      read_detections(f.write("b.txt",
                              "left:1 top:134 right:269 bottom:478 class:person 0.79\r\n"
                              "left: 10, top: 20, width: 30, height: 40, class: traffic light, score: 0.5\n"
                              "left:5 top:6 right:7 bottom:8 class:dining table 0.25\nleft:5 top:6 right:7 bottom:8 class:16\n"),
                      640, 480);
  REQUIRE(pairs.size() == 4);
  CHECK(pairs[0].class_id == 0);
  CHECK(pairs[0].score == 0.79F);
  CHECK(pairs[0].box.width == 268);
  CHECK(pairs[0].box.height == 344);
  CHECK(pairs[0].movable);
  CHECK(pairs[1].class_id == 9);
  CHECK(pairs[1].box.height == 40);
  CHECK(pairs[1].score == 0.5F);
  CHECK(pairs[2].class_id == 60);
  CHECK(pairs[2].score == 0.25F);
  CHECK(pairs[3].class_id == 16);
  CHECK(pairs[3].score == 1.0F);
  for (const char* bad : {"0 0.5 0.5 0.25", "0 0.5 x 0.25 0.5", "0 320 240 100 100", "martian 0.5 0.5 0.2 0.2", "left:1 top:2 class:person",
                          "left:9 top:2 right:3 bottom:8 class:person", "left:1 top:2 right:3 bottom:8 class:person 1.5",
                          "left:1 top:2 right:3 bottom:8 class:nobody 0.5"}) {
    CAPTURE(bad);
    try {
      (void)read_detections(f.write("bad.txt", std::string("0 0.5 0.5 0.2 0.2\n") + bad + "\n"), 640, 480);
      CHECK(false);
    } catch (const io_error& e) {
      CHECK(std::string(e.what()).find("bad.txt:2: ") != std::string::npos);
    }
  }
  CHECK_THROWS_AS((void)read_detections("/no/such/file.txt", 640, 480), io_error);
}

TEST_CASE("a log for a sequence, and a folder with a file per image") {
  const Folder f("log");
  const std::string log =
      f.write("all.txt", "# stamp left top width height score class\n10.0 1 2 30 40 0.5 0\n10.0 5 6 7 8 0.9 56\n10.033 1 2 3 4 1 0\n");
  DetectionLog one(log, 640, 480);
  CHECK(one.at(10.004).size() == 2);
  CHECK(one.at(10.03).size() == 1);
  CHECK(one.at(10.02).empty());
  CHECK(one.at(10.004)[1].class_id == 56);
  CHECK_THROWS_AS(DetectionLog(f.write("bad.txt", "10.0 1 2 3\n"), 640, 480), io_error);
  fs::create_directories(f.path / "each");
  f.write("each/1341846647.734028.txt", "0 0.5 0.5 0.5 0.5 0.7\n");
  f.write("each/1341846647.765000.txt", "");
  f.write("each/readme.md", "not this");
  DetectionLog each((f.path / "each").string(), 100, 100);
  REQUIRE(each.at(1341846647.734).size() == 1);
  CHECK(each.at(1341846647.734)[0].box.width == 50);
  CHECK(each.at(1341846647.765).empty());
  CHECK(each.at(1341846650.0).empty());
  fs::create_directories(f.path / "none");
  CHECK_THROWS_AS(DetectionLog((f.path / "none").string(), 100, 100), io_error);
  const auto names = read_class_names(f.write("names.txt", "ball\ntraffic cone\r\n\n"));
  CHECK(names == std::vector<std::string>{"ball", "traffic cone"});
  CHECK(coco_classes().size() == 80);
}

TEST_CASE("precomputed: masks and boxes of the stamp, unknown without") {
  const Folder f("masks");
  const Pinhole camera{100, 100, 49.5, 39.5, 100, 80};
  cv::Mat image(80, 100, CV_8U, cv::Scalar(0));
  cv::rectangle(image, {10, 20, 30, 40}, 255, cv::FILLED);
  fs::create_directories(f.path / "m");
  cv::imwrite((f.path / "m" / "5.000000.png").string(), image);
  f.write("boxes.txt", "5.0 60 10 20 20 0.8 0\n6.0 60 10 20 20 0.8 56\n6.0 0 0 10 10 0.6 0\n");
  opencv::PrecomputedMotion policy(camera, (f.path / "m").string(), (f.path / "boxes.txt").string());
  const Image<float> depth(100, 80, 1.0F);
  DynamicMask m;
  policy.observe(RgbdFrame{5.003, depth, depth}, Pose::Identity(), {}, m);
  CHECK(m.probability(20, 30) == 1.0F);
  CHECK(m.probability(70, 20) == doctest::Approx(0.9));
  CHECK(m.probability(50, 70) == 0.0F);
  CHECK(known_ratio(m) == 1.0);
  CHECK(policy.detections().size() == 1);
  policy.observe(RgbdFrame{6.0, depth, depth}, Pose::Identity(), {}, m);
  CHECK(m.probability(5, 5) == doctest::Approx(0.8));
  CHECK(m.known(20, 30) == 0);
  CHECK(m.known(70, 20) == 0);  // a chair does not move
  CHECK(policy.detections().size() == 2);
  cv::imwrite((f.path / "m" / "7.000000.png").string(), cv::Mat(10, 10, CV_8U, cv::Scalar(0)));
  opencv::PrecomputedMotion wrong(camera, (f.path / "m").string(), "");
  CHECK_THROWS_AS(wrong.observe(RgbdFrame{7.0, depth, depth}, Pose::Identity(), {}, m), io_error);
  opencv::FileUse use;
  opencv::PrecomputedMotion counted(camera, (f.path / "m").string(), (f.path / "boxes.txt").string(), {}, &use);
  for (double stamp : {4.0, 5.0, 6.0, 7.0}) counted.observe(RgbdFrame{stamp, depth, depth}, Pose::Identity(), {}, m);
  CHECK(use.masks == 1);
  CHECK(use.detections == 2);
  REQUIRE(use.problems.size() == 1);
  CHECK(use.problems[0].find("7.000000.png: the mask is 10x10, expected the size of the images, 100x80") != std::string::npos);
  CHECK(known_ratio(m) == 0.0);
  CHECK_THROWS_AS(opencv::PrecomputedMotion(camera, (f.path / "nowhere").string(), ""), io_error);
  CHECK_THROWS_AS(opencv::PrecomputedMotion(camera, "", ""), contract_error);
}

TEST_CASE("a mask of any depth and number of channels: what is not 0 in a colour is dynamic") {
  const Folder f("depths");
  const std::string file = (f.path / "mask.png").string();
  const auto read = [&](const cv::Mat& pixels) {
    cv::imwrite(file, pixels);
    const cv::Mat mask = opencv::read_mask(file, pixels.size());
    REQUIRE(mask.type() == CV_8UC1);
    return std::vector<int>(mask.begin<uchar>(), mask.end<uchar>());
  };
  CHECK(read((cv::Mat_<uchar>(1, 4) << 0, 1, 7, 255)) == std::vector<int>{0, 1, 7, 255});
  CHECK(read((cv::Mat_<ushort>(1, 6) << 0, 1, 255, 256, 512, 65535)) == std::vector<int>{0, 1, 255, 255, 255, 255});
  CHECK(read((cv::Mat_<cv::Vec3b>(1, 3) << cv::Vec3b(0, 0, 0), cv::Vec3b(1, 0, 0), cv::Vec3b(2, 9, 3))) == std::vector<int>{0, 1, 9});
  CHECK(read((cv::Mat_<cv::Vec4b>(1, 2) << cv::Vec4b(0, 0, 0, 255), cv::Vec4b(0, 4, 0, 255))) == std::vector<int>{0, 4});
  CHECK_THROWS_WITH_AS((void)opencv::read_mask(file, {3, 1}), doctest::Contains("the mask is 2x1, expected the size of the images, 3x1"),
                       io_error);
  std::ofstream(file) << "no image";
  CHECK_THROWS_AS((void)opencv::read_mask(file, {2, 1}), io_error);
}

TEST_CASE("every policy can be had by its name, alone and combined, and runs") {
  const testing::SyntheticSequence sequence("walking_xyz", [] {
    testing::SyntheticOptions o;
    o.width = 320;
    o.height = 240;
    return o;
  }());
  testing::SyntheticFrame f;
  std::vector<std::string> texts;
  for (const NamedPolicy& p : opencv::motion_table(sequence.camera(), {}, {})) {
    if (p.name == "dnn" || p.name == "precomputed") continue;  // need files
    texts.push_back(p.takes_policy() ? p.name + "(geometric)" : p.name);
  }
  texts.insert(texts.end(), {"motion", "semantic & motion", "geometric+residual", "temporal-filter(residual*multiview-depth)"});
  for (const std::string& text : texts) {
    CAPTURE(text);
    AnyMotionPolicy policy = opencv::motion_by_name(text, sequence.camera());
    DynamicMask m;
    for (int i = 0; i < 12; ++i) {
      sequence.render(3 * i, f);
      policy.observe(f.rgbd(), f.T_world_camera, {}, m);
      policy.remember(f.rgbd(), f.T_world_camera, m);
    }
    CHECK(m.probability.width() == 320);
    const bool needs_more =
        text == "none" || text == "epipolar" || text == "hog-people" || text == "semantic" || text == "semantic & motion";
    if (!needs_more) CHECK(dynamic_ratio(m) > 0.01);
  }
}

TEST_CASE("names that are wrong, or lack their files, say so") {
  const Pinhole camera{100, 100, 49.5, 39.5, 100, 80};
  const auto message = [&](const std::string& text) -> std::string {
    try {
      (void)opencv::motion_by_name(text, camera);
    } catch (const contract_error& e) {
      return e.what();
    }
    return {};
  };
  CHECK(message("geometrc").find("known are: geometric, epipolar") != std::string::npos);
  CHECK(message("dnn").find("needs the file of a network") != std::string::npos);
  CHECK(message("geometric+precomputed").find("needs a folder of masks") != std::string::npos);
  CHECK(message("mask-propagation").find("'mask-propagation' needs another policy in brackets") != std::string::npos);
  CHECK(message("residual(geometric)").find("takes no policy in brackets") != std::string::npos);
  CHECK(message("geometric +").find("character 12") != std::string::npos);
}

}  // namespace

TEST_CASE("an image too small for a person has none, whatever its shape") {
  opencv::HogPeople people;
  for (const auto& [width, height] : {std::pair<int, int>{1, 1}, {1, 480}, {640, 1}, {2, 3}, {63, 480}, {640, 127}}) {
    const Image<float> grey(width, height, 0.5F);
    CAPTURE(width);
    CAPTURE(height);
    CHECK(people.detect(RgbdFrame{0, grey, grey}).empty());
  }
}

TEST_CASE("outputs that are no numbers give no objects") {
  const float inf = std::numeric_limits<float>::infinity();
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), inf, -inf, 3e38F, -3e38F, 1e10F}) {
    CAPTURE(bad);
    for (int k = 0; k < 6; ++k) {  // YOLOv10: corners, score, class
      float row[6] = {10, 20, 40, 80, 0.9F, 7};
      row[k] = bad;
      const int shape[3] = {1, 1, 6};
      const auto found = opencv::decode({"out"}, {cv::Mat(3, shape, CV_32F, row)}, opencv::NetworkHead::YoloEnd, 64, 64, 0.5F);
      CAPTURE(k);
      CHECK(found.objects.size() == (k == 4 && bad > 0 ? 1 : 0));  // a score of more than one is one
    }
    for (int k = 1; k < 7; ++k) {  // image, class, score, corners as shares
      float row[7] = {0, 1, 0.9F, 0.25F, 0.25F, 0.5F, 0.75F};
      row[k] = bad;
      const int shape[4] = {1, 1, 1, 7};
      const auto found = opencv::decode({"out"}, {cv::Mat(4, shape, CV_32F, row)}, opencv::NetworkHead::Auto, 64, 64, 0.5F);
      CAPTURE(k);
      CHECK(found.objects.size() == (k == 2 && bad > 0 ? 1 : 0));
    }
    float box[4] = {10, 20, 40, 80};
    float label = bad;
    float score = 0.9F;
    const auto found = opencv::decode({"boxes", "labels", "scores"},
                                      {cv::Mat(1, 4, CV_32F, box), cv::Mat(1, 1, CV_32F, &label), cv::Mat(1, 1, CV_32F, &score)},
                                      opencv::NetworkHead::Rcnn, 64, 64, 0.5F);
    CHECK(found.objects.empty());
  }
}

TEST_CASE("ten thousand boxes of a network: three hundred are kept, the best ones") {
  std::vector<opencv::NetworkObject> all(10000);
  for (std::size_t i = 0; i < all.size(); ++i) {
    all[i].box = {static_cast<float>(i % 100) * 10, static_cast<float>(i / 100) * 10, 9, 9};
    all[i].score = static_cast<float>((i * 7919) % 10000) / 10000;
  }
  const std::vector<std::size_t> kept = opencv::suppress(all, 0.5F);
  REQUIRE(kept.size() == 300);
  for (const std::size_t i : kept) CHECK(all[i].score >= 0.97F);  // 300 of the scores 0, 0.0001, ... 0.9999 are
}
