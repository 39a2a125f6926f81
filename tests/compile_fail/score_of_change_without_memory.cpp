// expect: apso: a score of change needs `struct Memory {...};`, what it keeps of a frame
#include <apso/quality/assessor.hpp>

struct MyChange {
  static constexpr const char* name = "S_mine";
  using Value = apso::Deviation;
#ifdef CONTROL
  struct Memory {};
  void remember(const apso::FrameContext&, Memory&) {}
  apso::MaybeDeviation operator()(const apso::ChangeContext<Memory>&) { return apso::Deviation(0.0); }
#endif
};

using Assessor = apso::BasicAssessor<apso::PaperFrameScores, apso::ScoreList<MyChange>>;
void use(Assessor& assessor) { assessor.assess(apso::AssessmentInput{}); }
