// Association, ATE and RPE of any two trajectories: pairs within the limit, each pose once, errors that are numbers.
#include <apso/evaluate.hpp>

#include "input.hpp"

namespace {
apso::Trajectory trajectory(fuzz::Bytes& in) {
  apso::Trajectory out;
  double stamp = in.number(-10, 10);
  for (int n = in.below(40); n > 0; --n) {
    stamp += in.number(0, 0.05);
    out.push_back({stamp, in.pose()});
  }
  return out;
}
}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace apso;
  fuzz::Bytes in(data, size);
  const auto rule = static_cast<AssociationRule>(in.below(2));
  AteOptions ate_options;
  ate_options.association = rule;
  ate_options.max_difference = in.number(0, 1);
  ate_options.time_offset = in.number(-0.1, 0.1);
  RpeOptions rpe_options;
  rpe_options.delta = in.number(0, 1);
  rpe_options.unit = static_cast<DeltaUnit>(in.below(5));
  const Trajectory truth = trajectory(in);
  const Trajectory estimate = trajectory(in);
  try {
    const double limit = ate_options.max_difference > 0 ? ate_options.max_difference : default_max_difference(rule);
    std::vector<char> first(truth.size()), second(estimate.size());
    for (const StampMatch& m : associate(truth, estimate, rule, ate_options.max_difference, ate_options.time_offset)) {
      const double difference = truth[m.first].timestamp - (estimate[m.second].timestamp + ate_options.time_offset);
      fuzz::require(std::abs(difference) <= limit * (1 + 1e-12) + 1e-12, "pairs are within the limit");
      if (rule != AssociationRule::Tum) continue;
      fuzz::require(first[m.first] == 0 && second[m.second] == 0, "each pose has one partner");
      first[m.first] = second[m.second] = 1;
    }
    const auto a = ate(truth, estimate, ate_options);
    fuzz::require(a.statistics.rmse >= 0 && std::isfinite(a.statistics.rmse), "the ATE is a number");
    const auto r = rpe(truth, estimate, rpe_options);
    fuzz::require(r.translation.rmse >= 0 && std::isfinite(r.translation.rmse), "the RPE is a number");
  } catch (const contract_error& e) {
    fuzz::require(fuzz::printable_message(e.what()), "a message is printable");
  }
  return 0;
}
