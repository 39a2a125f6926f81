#include <doctest/doctest.h>

#include <string>

#include <apso/io/parameters.hpp>

#include "../contains.hpp"
#include "temporary_file.hpp"

namespace sample {
enum class Form { Round, Square };
[[maybe_unused]] constexpr std::array<const char*, 2> enum_names(Form) { return {"round", "square"}; }
struct Inner {
  double gain = 0.5;
  Form form = Form::Round;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("gain", s.gain, 0.0, 1.0);
    v("form", s.form);
  }
};
struct Outer {
  int count = 3;
  bool fast = false;
  Inner inner;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("count", s.count, 1, 10);
    v("fast", s.fast);
    v("inner", s.inner);
  }
};
}  // namespace sample

namespace {
std::string message_of(const std::string& yaml) {
  const TemporaryFile file(yaml);
  sample::Outer options;
  try {
    apso::read_parameters(file.path(), options);
  } catch (const apso::io_error& e) {
    return e.what();
  }
  return "";
}
}  // namespace

TEST_CASE("parameters are read, and what is not named keeps its value") {
  const TemporaryFile file("count: 7\ninner:\n  form: square\n");
  sample::Outer o;
  apso::read_parameters(file.path(), o);
  CHECK(o.count == 7);
  CHECK(o.fast == false);
  CHECK(o.inner.gain == 0.5);
  CHECK(o.inner.form == sample::Form::Square);
}

TEST_CASE("what is written is read back") {
  sample::Outer o;
  o.count = 9;
  o.fast = true;
  o.inner.gain = 0.125;
  o.inner.form = sample::Form::Square;
  const TemporaryFile file(apso::write_parameters(o));
  sample::Outer back;
  apso::read_parameters(file.path(), back);
  CHECK(back.count == 9);
  CHECK(back.fast);
  CHECK(back.inner.gain == 0.125);
  CHECK(back.inner.form == sample::Form::Square);
}

TEST_CASE("bad parameters are named with line, field and what was expected") {
  CHECK(contains(message_of("count: 7\ninner:\n  gian: 0.1\n"), ":3: unknown option 'inner.gian', known here: gain, form"));
  CHECK(contains(message_of("count: 11\n"), ":1: 'count' = 11 is out of range [1, 10]"));
  CHECK(contains(message_of("\ncount: many\n"), ":2: 'count' must be a whole number"));
  CHECK(contains(message_of("inner: {form: oval}\n"), "'inner.form' must be one of: round, square"));
  CHECK(contains(message_of("inner: {gain: .nan}\n"), "out of range"));
  CHECK(contains(message_of("fast: perhaps\n"), "'fast' must be true or false"));
  CHECK(contains(message_of("count: [1\n"), "not valid YAML"));
  CHECK(contains(message_of("- 1\n- 2\n"), ":1: the settings must be a map"));
  sample::Outer o;
  CHECK_THROWS_AS(apso::read_parameters("no/such/file.yaml", o), apso::io_error);
}

TEST_CASE("one field is set by its path, and nothing else changes") {
  sample::Outer o;
  apso::set_parameter(o, "inner.gain", "0.25");
  CHECK(o.inner.gain == 0.25);
  apso::set_parameter(o, "inner.form", "square");
  CHECK(o.inner.form == sample::Form::Square);
  apso::set_parameter(o, "count", "4");
  CHECK(o.count == 4);
  CHECK_FALSE(o.fast);
  const auto message = [&](const char* path, const char* value) {
    try {
      apso::set_parameter(o, path, value);
    } catch (const apso::io_error& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  CHECK(message("inner.gian", "1") == "unknown option 'inner.gian', known here: gain, form");
  CHECK(message("outer.gain", "1") == "unknown option 'outer', known here: count, fast, inner");
  CHECK(message("count", "11") == "'count' = 11 is out of range [1, 10]");
  CHECK(contains(message("inner", "3"), "'inner' must be a map"));
  CHECK(contains(message("", "3"), "unknown option"));
  CHECK(contains(message("count", "[1"), "not valid YAML"));
  CHECK(o.count == 4);
}

TEST_CASE("the list of parameters has every field with value and range") {
  const auto list = apso::list_parameters(sample::Outer{});
  REQUIRE(list.size() == 4);
  CHECK(list[0].path == "count");
  CHECK(list[0].value == "3");
  CHECK(list[0].range == "1 .. 10");
  CHECK(list[1].path == "fast");
  CHECK(list[1].value == "false");
  CHECK(list[1].range == "false | true");
  CHECK(list[2].path == "inner.gain");
  CHECK(list[2].value == "0.5");
  CHECK(list[3].path == "inner.form");
  CHECK(list[3].value == "round");
  CHECK(list[3].range == "round | square");
}

TEST_CASE("validate names field, value and range") {
  sample::Outer o;
  o.inner.gain = 2;
  try {
    apso::validate(o, "outer");
    FAIL("accepted");
  } catch (const apso::contract_error& e) {
    CHECK(contains(e.what(), "outer.inner.gain = 2 is out of range [0, 1]"));
  }
}

TEST_CASE("a file that says two things is refused with the line of the second") {
  CHECK(contains(message_of("count: 7\nfast: true\ncount: 8\n"), ":3: 'count' is given twice"));
  CHECK(contains(message_of("inner:\n  gain: 0.1\n  gain: 0.2\n"), ":3: 'gain' is given twice"));
  CHECK(contains(message_of("count: 7\n---\ncount: 8\n"), ": a second document begins"));
  CHECK(message_of("---\ncount: 7\n").empty());
  CHECK(message_of("").empty());
  sample::Outer o;
  CHECK_THROWS_WITH_AS(apso::set_parameter(o, "inner", "{gain: 0.1, gain: 0.2}"), "'inner': 'gain' is given twice", apso::io_error);
}

TEST_CASE("a folder as parameter file is named as one") {
  sample::Outer o;
  const std::string folder = std::filesystem::temp_directory_path().string();
  CHECK_THROWS_WITH_AS(apso::read_parameters(folder, o), (folder + ": is a folder, expected a YAML file of parameters").c_str(),
                       apso::io_error);
}

TEST_CASE("YAML that contains itself, doubles with every alias, or is nested without end is refused") {
  CHECK(contains(message_of("inner: &a\n  gain: *a\n"), "nested deeper than 32 levels"));
  std::string bomb = "a0: &a0 [1, 1]\n";
  for (int i = 1; i < 30; ++i) {
    const std::string before = "*a" + std::to_string(i - 1);
    bomb += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [" + before + ", " + before + "]\n";
  }
  CHECK(contains(message_of(bomb), "more than 10000 values"));
  for (const int depth : {40, 100000}) {
    const std::string text =
        message_of("count: " + std::string(static_cast<std::size_t>(depth), '[') + std::string(static_cast<std::size_t>(depth), ']'));
    CHECK_FALSE(text.empty());
  }
}

TEST_CASE("control characters in YAML are quoted without their effect") {
  const std::string text = message_of("\"co\\e[31munt\": 7\n");
  CHECK(text.find('\x1b') == std::string::npos);
  CHECK(contains(text, "unknown option 'co\\x1b[31munt'"));
}

TEST_CASE("YAML in which the reader finds empty documents without end is refused") {
  CHECK(contains(message_of(",name: 1\ncount: 7\n"), ": a second document begins"));
  CHECK(contains(message_of("count: 7\n}\n"), ":"));
  CHECK(message_of("count: 7\n...\n").empty());
}
