#include "core/reconstruct/checkpoint.h"

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/model_files/checkpoint.h"
#include "core/reconstruct/scene_needs.h"

namespace pepeseg {
namespace {

// Lists the sections once, for writing and for reading: name, version, value.
template <class AnyCheckpoint, class Visit>
void VisitSections(AnyCheckpoint& checkpoint, const Visit& visit) {
  visit("counters", 4, checkpoint.counters);
  visit("needs", 1, checkpoint.needs);
  visit("random", 1, checkpoint.random);
  visit("views_left", 1, checkpoint.views_left);
  visit("gaussians", 1, checkpoint.gaussians.shape);
  visit("parameters", 1, checkpoint.gaussians.parameters);
  visit("moment1", 1, checkpoint.gaussians.moment1);
  visit("moment2", 1, checkpoint.gaussians.moment2);
  visit("num_steps", 1, checkpoint.gaussians.num_steps);
  visit("grad_sum", 1, checkpoint.gaussians.grad_sum);
  visit("square_sum", 1, checkpoint.gaussians.square_sum);
  visit("num_visible", 1, checkpoint.gaussians.num_visible);
  visit("refinable", 1, checkpoint.gaussians.refinable);
}

// Returns DATA_LOSS unless all planes have the size that count and SH degree call for and all
// floating-point numbers are finite. `refinable` may be empty: refinement was not open.
absl::Status ValidateRows(const GaussianRows& rows) {
  const auto [count, sh_degree] = rows.shape;
  if (count < 1 || sh_degree < 0 || sh_degree > kMaxShDegree) {
    return absl::DataLossError(
        absl::StrCat("number of Gaussians ", count, " or SH degree ", sh_degree, " out of range"));
  }
  const int64_t num_planes = NumPlanes(static_cast<int>(sh_degree));
  // num_steps comes first: it proves that `count` numbers exist, so that the products below cannot
  // overflow.
  RETURN_IF_ERROR(CheckSize("num_steps", rows.num_steps.size(), count));
  RETURN_IF_ERROR(CheckSize("parameters", rows.parameters.size(), num_planes * count));
  RETURN_IF_ERROR(CheckSize("moment1", rows.moment1.size(), num_planes * count));
  RETURN_IF_ERROR(CheckSize("moment2", rows.moment2.size(), num_planes * count));
  RETURN_IF_ERROR(CheckSize("grad_sum", rows.grad_sum.size(), count));
  RETURN_IF_ERROR(CheckSize("square_sum", rows.square_sum.size(), count));
  RETURN_IF_ERROR(CheckSize("num_visible", rows.num_visible.size(), count));
  if (!rows.refinable.empty()) {
    RETURN_IF_ERROR(CheckSize("refinable", rows.refinable.size(), count));
  }
  RETURN_IF_ERROR(CheckFinite("parameters", rows.parameters));
  RETURN_IF_ERROR(CheckFinite("moment1", rows.moment1));
  RETURN_IF_ERROR(CheckFinite("moment2", rows.moment2));
  RETURN_IF_ERROR(CheckFinite("grad_sum", rows.grad_sum));
  return CheckFinite("square_sum", rows.square_sum);
}

}  // namespace

std::vector<CheckpointSection> SectionsOf(const GaussianCheckpoint& checkpoint) {
  std::vector<CheckpointSection> sections;
  VisitSections(checkpoint, SectionWriter{sections});
  return sections;
}

absl::StatusOr<GaussianCheckpoint> GaussianCheckpoint::Read(
    std::span<const CheckpointSection> sections) {
  GaussianCheckpoint checkpoint;
  const SectionReader reader(sections);
  VisitSections(checkpoint, reader);
  RETURN_IF_ERROR(reader.Finish());
  RETURN_IF_ERROR(Validate(checkpoint));
  return checkpoint;
}

absl::Status Validate(const GaussianCheckpoint& checkpoint) {
  if (checkpoint.counters.step < 0) {
    return absl::DataLossError(absl::StrCat("step ", checkpoint.counters.step, " is negative"));
  }
  // The position runs ahead of the step when part of the schedule was skipped, never behind it.
  if (checkpoint.counters.position < checkpoint.counters.step) {
    return absl::DataLossError(absl::StrCat("step ", checkpoint.counters.step,
                                            " exceeds its schedule position, ",
                                            checkpoint.counters.position));
  }
  RETURN_IF_ERROR(CheckSize("needs", checkpoint.needs.size(), SceneNeeds::kNumState));
  return ValidateRows(checkpoint.gaussians);
}

}  // namespace pepeseg
