#include "core/sfm/sfm_options.h"

#include <algorithm>

#include "core/sfm/front/pair_selection.h"

namespace pepeseg {
namespace {

// Core seconds. Photographs are shrunk to kFeatureSide before features are extracted.
constexpr double kExtracting = 1.35;  // for each megapixel
constexpr double kDecoding = 0.01;    // the same for own features
// Own features, for each photograph, and for each megapixel up to that at which the coarser octaves
// have enough.
constexpr double kOwnExtracting = 0.015, kOwnPyramid = 0.14, kMostPyramid = 0.75;
constexpr double kMostMegapixels = 3;       // of a photograph that was shrunk
constexpr double kColmapMatch = 1.1e-4;     // for each pair and feature: an approximate search
constexpr double kOwnMatch = 5e-10;         // for each pair of features of a pair
constexpr double kOwnScore = 5e-10;         // the same, with 256 features of either photograph
constexpr double kVerify = 1e-3;            // for each pair
constexpr double kMapping = 0.006;          // for each pair of photographs, compared or not
constexpr double kOwnPlacing = 0.17;        // for each photograph, by the own mapper
constexpr double kOwnPlacingThreads = 1.5;  // of many, its core seconds over its seconds
constexpr double kDeviceShare = 0.02;       // of the products' time, on a GPU
constexpr double kLargest = 256;
// Numbers of photographs of which all pairs are compared.
constexpr size_t kMostOnCores = 80, kMostOnDevice = 600;

}  // namespace

void VisitOptions(SfmOptions& o, OptionVisitor visit) {
  const auto engine = [](SfmEngine* field) {
    return WordsOf<SfmEngine>(
        field,
        {{"auto", SfmEngine::kAuto}, {"own", SfmEngine::kOwn}, {"colmap", SfmEngine::kColmap}});
  };
  visit(
      {"matching", WordsOf<SfmMatching>(&o.matching, {{"auto", SfmMatching::kByCapture},
                                                      {"exhaustive", SfmMatching::kExhaustive},
                                                      {"sequential", SfmMatching::kSequential}})});
  visit({"max_features", &o.max_features, Range{128, 32'768}});
  visit({"sequential_overlap", &o.sequential_overlap, Range{1, 100}});
  visit({"min_registered_share", &o.min_registered_share, Range{0, 1}});
  visit({"max_seconds", &o.max_seconds, Range{1, 7 * 24 * 3600}});
  visit({"max_video_frames", &o.max_video_frames, Range{3, 2000}});
  visit({"front", engine(&o.front)});
  visit({"features", engine(&o.features)});
  visit({"mapper", engine(&o.mapper)});
}

absl::Status Validate(const SfmOptions& options) { return CheckOptions(options); }

ComparisonOptions ComparisonFor(const SfmLoad& load, const SfmOptions& options) {
  ComparisonOptions comparison;
  const bool by_capture = options.matching == SfmMatching::kByCapture;
  if (options.matching == SfmMatching::kExhaustive) comparison.choice = PairChoice::kAll;
  if (options.matching == SfmMatching::kSequential || (by_capture && load.in_sequence)) {
    comparison.choice = PairChoice::kInSequence;
  }
  comparison.overlap = static_cast<size_t>(options.sequential_overlap);
  comparison.max_all = load.on_device ? kMostOnDevice : kMostOnCores;
  return comparison;
}

NumPairs NumSfmPairs(const SfmLoad& load, const SfmOptions& options) {
  ComparisonOptions comparison = ComparisonFor(load, options);
  if (options.front != SfmEngine::kColmap) return ExpectedPairs(load.num_photographs, comparison);
  // COLMAP selects no pairs: all, or neighbours and those at distances that are powers of two.
  const bool in_sequence = comparison.choice == PairChoice::kInSequence;
  const auto n = static_cast<size_t>(load.num_photographs);
  const auto pairs =
      in_sequence ? NeighborPairs(n, comparison.overlap, /*powers=*/true) : AllPairs(n);
  return {0, static_cast<int64_t>(pairs.size())};
}

SfmWork ExpectedSfmWork(const SfmLoad& load, const SfmOptions& options) {
  const auto n = static_cast<double>(load.num_photographs);
  const double features = options.max_features;
  const NumPairs pairs = NumSfmPairs(load, options);
  const auto compared = static_cast<double>(pairs.compared);
  const double share = load.on_device ? kDeviceShare : 1;
  SfmWork work;
  const double extracting = kExtracting * std::min(load.megapixels, kMostMegapixels);
  const double own = kOwnExtracting + kOwnPyramid * std::min(load.megapixels, kMostPyramid);
  const double own_extracting = kDecoding * load.megapixels + (load.on_device ? 0 : own);
  work.extracting = n * (options.features == SfmEngine::kColmap ? extracting : own_extracting);
  work.choosing = share * kOwnScore * 2 * kLargest * features * static_cast<double>(pairs.scored);
  work.matching = options.front == SfmEngine::kColmap
                      ? kColmapMatch * features * compared
                      : (share * kOwnMatch * features * features + kVerify) * compared;
  const bool by_number =
      options.mapper == SfmEngine::kAuto && load.num_photographs < kFewestForOwnMapper;
  const bool own_mapper =
      options.mapper != SfmEngine::kColmap && options.front != SfmEngine::kColmap && !by_number;
  work.mapping = own_mapper ? kOwnPlacing * n : kMapping * n * n;
  work.mapping_threads = own_mapper ? kOwnPlacingThreads : 1;
  return work;
}

}  // namespace pepeseg
