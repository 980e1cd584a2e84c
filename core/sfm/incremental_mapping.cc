#include "core/sfm/incremental_mapping.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

using Words = std::vector<std::string>;

// Fewer rounds of bundle adjustment: 20 to 50 % less work at the same error of the poses
// (tests/bench/results/poses.md). One thread: poses that do not depend on the number of threads,
// at no cost, as the mapper's own part is one thread.
const Words kOwnMapping = {"--Mapper.num_threads",
                           "1",
                           "--Mapper.ba_global_images_ratio",
                           "1.3",
                           "--Mapper.ba_global_points_ratio",
                           "1.3",
                           "--Mapper.ba_global_max_num_iterations",
                           "20",
                           "--Mapper.ba_global_max_refinements",
                           "2",
                           "--Mapper.ba_local_max_num_iterations",
                           "15",
                           "--Mapper.ba_local_max_refinements",
                           "1"};
constexpr size_t kMostFurtherRuns = 3;

// Runs of the mapper on one database.
class IncrementalMapping {
 public:
  IncrementalMapping(const MappingInput& input,
                     absl::FunctionRef<absl::Status(const ColmapProgram::Command&)> run)
      : input_(input), run_(run) {}

  absl::StatusOr<MappedModels> Map();

 private:
  absl::StatusOr<MappedModels> RunOnce(const Words& options);
  double MaxError() const;

  const MappingInput& input_;
  absl::FunctionRef<absl::Status(const ColmapProgram::Command&)> run_;
  int num_runs_ = 0;
};

// Returns the largest error of a match that agrees, in pixels of the photographs.
double IncrementalMapping::MaxError() const {
  return kMostOffEpipolar / input_.compared->FeatureScale();
}

absl::StatusOr<MappedModels> IncrementalMapping::RunOnce(const Words& options) {
  const std::filesystem::path output = input_.models / std::to_string(num_runs_++);
  std::error_code error;
  if (std::filesystem::create_directory(output, error); error) {
    return absl::InternalError(
        absl::StrCat("cannot make ", output.string(), ": ", error.message()));
  }
  // random_seed: RANSAC is repeatable with one thread. min_model_size: by default COLMAP drops
  // small models, but JudgeModels needs them to find a second place.
  Words words = {"--random_seed",
                 "1",
                 "--database_path",
                 input_.database.string(),
                 "--image_path",
                 input_.images.string(),
                 "--output_path",
                 output.string(),
                 "--Mapper.min_model_size",
                 "3"};
  const Words threads = {"--Mapper.num_threads", input_.threads};
  const Words& further = input_.compared ? kOwnMapping : threads;
  words.insert(words.end(), further.begin(), further.end());
  words.insert(words.end(), options.begin(), options.end());
  RETURN_IF_ERROR(run_({"mapper", words, "failed to create sparse model"}));
  MappedModels mapped;
  ASSIGN_OR_RETURN(mapped.models, ReadSfmModels(output));
  if (input_.compared && !mapped.models.empty()) {
    ASSIGN_OR_RETURN(mapped.agreement,
                     MeasureAgreement(input_.compared->features, input_.compared->pairs,
                                      mapped.models.front(), MaxError()));
  }
  return mapped;
}

// COLMAP starts from the pair with most matches that has parallax. If both photographs show one
// plane, its pose may be the mirrored one; then no neighbour fits, and photographs that were not
// tried before the adjustment comes next, among them those with nothing but wrong matches.
absl::StatusOr<MappedModels> IncrementalMapping::Map() {
  ASSIGN_OR_RETURN(MappedModels best, RunOnce({}));
  if (!input_.compared || best.agreement.IsPlausible()) return best;
  for (const auto& [first, second] : InitialPairs(input_.compared->features, input_.compared->pairs,
                                                  kMostFurtherRuns, MaxError())) {
    ASSIGN_OR_RETURN(
        MappedModels other,
        RunOnce({"--Mapper.init_image_id1", std::to_string(first), "--Mapper.init_image_id2",
                 std::to_string(second), "--Mapper.init_min_tri_angle", "2",
                 "--Mapper.init_max_forward_motion", "1", "--Mapper.multiple_models", "0"}));
    if (other.agreement.agreeing > best.agreement.agreeing) {
      best = std::move(other);
    }
    if (best.agreement.IsPlausible()) break;
  }
  return best;
}

}  // namespace

absl::StatusOr<MappedModels> MapIncrementally(
    const MappingInput& input, absl::FunctionRef<absl::Status(const ColmapProgram::Command&)> run) {
  return IncrementalMapping(input, run).Map();
}

}  // namespace pepeseg
