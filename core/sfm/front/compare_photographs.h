#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/sfm/front/colmap_database.h"
#include "kernels/backend.h"

namespace pepeseg {

// Which pairs are compared.
enum class PairChoice {
  kAuto,        // all of few photographs, else those that PairSelection takes
  kAll,         //
  kInSequence,  // neighbours in the order of the photographs, and loops that PairSelection finds
};

struct ComparisonOptions {
  PairChoice choice = PairChoice::kAuto;
  size_t overlap = 10;  // kInSequence: see NeighborPairs
  // kInSequence: maximum number of photographs, evenly spread, among which loops are looked for.
  size_t max_for_loops = 300;
  size_t max_all = 80;         // kAuto: number of photographs of which all pairs are compared
  double feature_side = 2000;  // longer side to which photographs were shrunk for features, pixels
  int num_threads = 0;         // that verify; 0: one for each core
};

// Reports pairs that are done, of those known so far. Called on the calling thread, several times a
// second. An error ends the comparison.
struct ComparisonProgress {
  bool choosing = false;  // true: pairs are scored; false: they are matched and verified
  int64_t done = 0, total = 0;
};
using ComparisonProgressFn = absl::FunctionRef<absl::Status(const ComparisonProgress&)>;

// Matches the photographs and verifies the matches (EstimateTwoViewGeometry). Where verified pairs
// leave several groups, or a group that hangs together by one pair, the next best pairs of the
// photographs there are compared, until that joins nothing more. Pairs are ordered as AllPairs
// within a round. Results depend neither on the number of threads nor on the backend. Returns the
// errors of `progress` and of DescriptorMatcher.
absl::StatusOr<std::vector<ComparedPair>> ComparePhotographs(Backend& backend,
                                                             const DatabaseFeatures& features,
                                                             const ComparisonOptions& options,
                                                             ComparisonProgressFn progress);

// What CompareInDatabase found, without descriptors and matches that were not verified.
struct ComparedDatabase {
  DatabaseFeatures features;
  std::vector<ComparedPair> pairs;
  double feature_side = 0;  // see ComparisonOptions

  // Returns by how much the largest photographs were shrunk for features: at most 1.
  double FeatureScale() const;
};

// Reads the features of a COLMAP database, compares the photographs, and creates a database `to`
// with the features (SortedByName) and the pairs. `from` stays as it is. Errors of
// ReadDatabaseFeatures, ComparePhotographs, CreateDatabase and WritePairs.
absl::StatusOr<ComparedDatabase> CompareInDatabase(Backend& backend,
                                                   const std::filesystem::path& from,
                                                   const std::filesystem::path& to,
                                                   const ComparisonOptions& options,
                                                   ComparisonProgressFn progress);

// Returns the number of pairs that are scored, and an estimate of those that are compared.
struct NumPairs {
  int64_t scored = 0, compared = 0;
};
NumPairs ExpectedPairs(int64_t num_photographs, const ComparisonOptions& options);

}  // namespace pepeseg
