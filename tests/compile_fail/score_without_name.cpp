// expect: apso: a score needs `static constexpr const char* name`
#include <apso/quality/score_list.hpp>

struct MyScore {
#ifdef CONTROL
  static constexpr const char* name = "S_mine";
#endif
  using Value = apso::Quality;
  apso::MaybeQuality operator()(const apso::FrameContext&) { return apso::Quality(1.0); }
};

constexpr auto use() { return apso::score_traits<MyScore>::better; }
constexpr auto better = use();
