#include "core/features/checkpoint.h"

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/model_files/checkpoint.h"
#include "kernels/ops/feature.h"

namespace pepeseg {
namespace {

// Calls visit(name, version, value) for each section. The only list of them, for writing and
// reading.
template <class AnyCheckpoint, class Visit>
void VisitSections(AnyCheckpoint& checkpoint, const Visit& visit) {
  visit("counters", 2, checkpoint.counters);
  visit("losses", 1, checkpoint.losses);
  visit("random", 1, checkpoint.drawer.random);
  visit("views_left", 1, checkpoint.drawer.views_left);
  visit("centroid_random", 1, checkpoint.centroids.random);
  visit("centroids_upper", 1, checkpoint.centroids.upper);
  visit("centroids_lower", 1, checkpoint.centroids.lower);
  visit("features", 1, checkpoint.rows.features);
  visit("moment1", 1, checkpoint.rows.moment1);
  visit("moment2", 1, checkpoint.rows.moment2);
  visit("last_step", 1, checkpoint.rows.last_step);
  visit("gate", 1, checkpoint.rows.gate);
  visit("gate_moment1", 1, checkpoint.rows.gate_moment1);
  visit("gate_moment2", 1, checkpoint.rows.gate_moment2);
}

// Returns DATA_LOSS unless `values` has the expected size and only finite numbers.
absl::Status CheckNumbers(const char* name, const std::vector<float>& values, int64_t expected) {
  RETURN_IF_ERROR(CheckSize(name, values.size(), expected));
  return CheckFinite(name, values);
}

// Returns DATA_LOSS unless `values` are finite and a whole number of centroids.
absl::Status CheckCentroids(const char* name, const std::vector<float>& values) {
  // Rounds down to whole centroids, so that CheckSize refuses a remainder.
  const auto size = static_cast<int64_t>(values.size());
  return CheckNumbers(name, values, size / kFeatureSize * kFeatureSize);
}

}  // namespace

std::vector<CheckpointSection> SectionsOf(const FeatureCheckpoint& checkpoint) {
  std::vector<CheckpointSection> sections;
  VisitSections(checkpoint, SectionWriter{sections});
  return sections;
}

absl::StatusOr<FeatureCheckpoint> FeatureCheckpoint::Read(
    std::span<const CheckpointSection> sections) {
  FeatureCheckpoint checkpoint;
  const SectionReader reader(sections);
  VisitSections(checkpoint, reader);
  RETURN_IF_ERROR(reader.Finish());
  RETURN_IF_ERROR(Validate(checkpoint));
  return checkpoint;
}

absl::Status Validate(const FeatureCheckpoint& checkpoint) {
  const auto& [step, steps_of_chunk, count, num_left_out, left_out_after] = checkpoint.counters;
  if (step < 0 || steps_of_chunk < 0 || steps_of_chunk > step || count < 1 || num_left_out < 0 ||
      left_out_after < 0 || left_out_after > step) {
    return absl::DataLossError(absl::StrCat("counters are out of range: step ", step,
                                            ", steps_of_chunk ", steps_of_chunk, ", num_gaussians ",
                                            count, ", num_left_out ", num_left_out,
                                            ", left_out_after ", left_out_after));
  }
  RETURN_IF_ERROR(CheckSize("losses", checkpoint.losses.size(), 3));
  const FeatureRowsState& rows = checkpoint.rows;
  // Checked first: the count is then the size of an array in memory, so that the products below
  // cannot overflow.
  RETURN_IF_ERROR(CheckSize("last_step", rows.last_step.size(), count));
  RETURN_IF_ERROR(CheckNumbers("features", rows.features, count * kFeatureSize));
  RETURN_IF_ERROR(CheckNumbers("moment1", rows.moment1, count * kFeatureSize));
  RETURN_IF_ERROR(CheckNumbers("moment2", rows.moment2, count * kFeatureSize));
  // FeatureTrainer::Resume compares the size with the options.
  const int gate_size = rows.gate.size() == kTwoLayerGateSize ? kTwoLayerGateSize : kGateSize;
  RETURN_IF_ERROR(CheckNumbers("gate", rows.gate, gate_size));
  RETURN_IF_ERROR(CheckNumbers("gate_moment1", rows.gate_moment1, gate_size));
  RETURN_IF_ERROR(CheckNumbers("gate_moment2", rows.gate_moment2, gate_size));
  RETURN_IF_ERROR(CheckCentroids("centroids_upper", checkpoint.centroids.upper));
  return CheckCentroids("centroids_lower", checkpoint.centroids.lower);
}

}  // namespace pepeseg
