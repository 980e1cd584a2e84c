#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "core/sfm/front/colmap_database.h"
#include "core/sfm/sfm_model.h"

namespace pepeseg {

// Agreement of a model with the verified matches of its photographs, which the mapper used in
// part. Repeated patterns, such as a wallpaper, give wrong matches in any model: 6 to 8 % of all on
// fox, up to 34 % of one photograph on fruit_table. Misplaced photographs contradict the true ones:
// 14 to 30 % of all, or more than 40 % of one photograph.
struct ModelAgreement {
  int64_t agreeing = 0, disagreeing = 0;  // matches of pairs of registered photographs
  // Names in COLMAP of the photographs with more than 40 % disagreeing matches, sorted.
  std::vector<std::string> doubtful;

  // Returns whether at most 10 % of all matches disagree, and no photograph is doubtful.
  bool IsPlausible() const;
};

// Maximum distance of an agreeing match from its epipolar lines, in pixels of the photographs as
// they were shrunk for features, where verification has 3 (compare_photographs.cc).
inline constexpr double kMostOffEpipolar = 4;

// Counts the verified matches that are at most `max_error` pixels from the epipolar lines of the
// model's poses. Reads the model's folder: errors of ReadColmapImages and ReadColmapCameras.
absl::StatusOr<ModelAgreement> MeasureAgreement(const DatabaseFeatures& features,
                                                std::span<const ComparedPair> pairs,
                                                const SfmModel& model, double max_error);

// Returns up to `count` pairs to start a model from, by COLMAP's ids, the best first: general pairs
// with at least 30 matches that are more than `max_error` pixels off their homography. Such a pair
// has one pose; one of a plane has two, of which the mapper may take the wrong one.
std::vector<std::pair<int64_t, int64_t>> InitialPairs(const DatabaseFeatures& features,
                                                      std::span<const ComparedPair> pairs,
                                                      size_t count, double max_error);

}  // namespace pepeseg
