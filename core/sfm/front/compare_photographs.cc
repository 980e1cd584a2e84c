#include "core/sfm/front/compare_photographs.h"

#include <algorithm>
#include <optional>
#include <span>
#include <utility>

#include "core/base/status_macros.h"
#include "core/sfm/front/descriptor_matcher.h"
#include "core/sfm/front/pair_selection.h"
#include "kernels/thread_pool.h"

namespace pepeseg {
namespace {

constexpr size_t kBest = 12;         // pairs of a photograph in each round of the selection
constexpr size_t kLoops = 6;         // the same for photographs in sequence
constexpr size_t kNumNeighbors = 2;  // neighbours that are compared whatever their score
constexpr double kMaxError = 3;      // pixels of the photograph as it was shrunk for features

// Returns the pairs that are compared whatever their scores.
std::vector<PhotographPair> GivenPairs(size_t num_photographs, const ComparisonOptions& options) {
  const bool in_sequence = options.choice == PairChoice::kInSequence;
  return NeighborPairs(num_photographs, in_sequence ? options.overlap : kNumNeighbors, in_sequence);
}

// Returns the pairs that are scored: all, or those of photographs of a sequence, evenly spread,
// that are not compared anyway.
std::vector<PhotographPair> ScoredPairs(size_t num_photographs, const ComparisonOptions& options) {
  if (options.choice != PairChoice::kInSequence) return AllPairs(num_photographs);
  const size_t most = std::max<size_t>(1, options.max_for_loops);
  const size_t stride = std::max<size_t>(1, (num_photographs + most - 1) / most);
  std::vector<PhotographPair> pairs;
  for (size_t second = 0; second < num_photographs; second += stride) {
    for (size_t first = 0; first + options.overlap < second; first += stride) {
      pairs.push_back({first, second});
    }
  }
  return pairs;
}

// One comparison. Run() is the whole of it.
class Comparison {
 public:
  Comparison(Backend& backend, const DatabaseFeatures& features, const ComparisonOptions& options,
             ComparisonProgressFn progress)
      : backend_(backend),
        features_(features),
        options_(options),
        progress_(progress),
        pool_(options.num_threads) {}

  absl::StatusOr<std::vector<ComparedPair>> Run();

 private:
  size_t num_photographs() const { return features_.images.size(); }
  absl::StatusOr<PairScores> Score();
  absl::Status CompareAll(const std::vector<PhotographPair>& pairs);
  absl::Status CompareSelected();
  void Verify(ComparedPair& pair) const;
  TwoViewCamera CameraOf(size_t photograph) const;
  PhotographGroups Groups() const;

  Backend& backend_;
  const DatabaseFeatures& features_;
  const ComparisonOptions& options_;
  ComparisonProgressFn progress_;
  ThreadPool pool_;
  std::optional<DescriptorMatcher> matcher_;
  std::vector<ComparedPair> compared_;
};

TwoViewCamera Comparison::CameraOf(size_t photograph) const {
  const DatabaseCamera& camera = features_.cameras[features_.images[photograph].camera];
  // A focal length that is not from EXIF is a default, which says nothing.
  const bool knows_focal = camera.knows_focal && !camera.params.empty();
  return {camera.width, camera.height, knows_focal ? camera.params[0] : 0};
}

void Comparison::Verify(ComparedPair& pair) const {
  const TwoViewCameras cameras{CameraOf(pair.first), CameraOf(pair.second)};
  const int side = std::max(
      {cameras.first.width, cameras.first.height, cameras.second.width, cameras.second.height});
  TwoViewOptions options;
  options.max_error = kMaxError * std::max(1.0, side / options_.feature_side);
  pair.geometry = EstimateTwoViewGeometry(features_.images[pair.first].features.keypoints,
                                          features_.images[pair.second].features.keypoints,
                                          pair.matches, cameras, options);
  // Such a pair says nothing about the place.
  if (pair.geometry.kind == TwoViewKind::kWatermark) pair.geometry.inliers.clear();
}

absl::StatusOr<PairScores> Comparison::Score() {
  PairScores scores(num_photographs());
  const std::vector<PhotographPair> scored = ScoredPairs(num_photographs(), options_);
  const auto total = static_cast<int64_t>(scored.size());
  for (std::span<const PhotographPair> left = scored; !left.empty();) {
    RETURN_IF_ERROR(progress_({true, total - static_cast<int64_t>(left.size()), total}));
    const auto batch = left.first(matcher_->BatchOf(left, /*for_score=*/true));
    ASSIGN_OR_RETURN(const std::vector<int64_t> counts, matcher_->Score(batch));
    for (size_t i = 0; i < batch.size(); ++i) {
      scores.Add(batch[i].first, batch[i].second, counts[i]);
    }
    left = left.subspan(batch.size());
  }
  return scores;
}

// Matches and verifies pairs, batch by batch.
absl::Status Comparison::CompareAll(const std::vector<PhotographPair>& pairs) {
  const auto total = static_cast<int64_t>(compared_.size() + pairs.size());
  for (std::span<const PhotographPair> left = pairs; !left.empty();) {
    RETURN_IF_ERROR(progress_({false, static_cast<int64_t>(compared_.size()), total}));
    const auto batch = left.first(matcher_->BatchOf(left, /*for_score=*/false));
    ASSIGN_OR_RETURN(std::vector<std::vector<FeatureMatch>> matches, matcher_->Match(batch));
    const size_t first = compared_.size();
    for (size_t i = 0; i < batch.size(); ++i) {
      compared_.push_back({batch[i].first, batch[i].second, std::move(matches[i]), {}});
    }
    pool_.ParallelFor(static_cast<int64_t>(batch.size()),
                      [&](int64_t i, int) { Verify(compared_[first + i]); });
    left = left.subspan(batch.size());
  }
  return progress_({false, total, total});
}

PhotographGroups Comparison::Groups() const {
  std::vector<PhotographPair> verified;
  for (const ComparedPair& pair : compared_) {
    if (!pair.geometry.inliers.empty()) verified.push_back({pair.first, pair.second});
  }
  return GroupsOf(num_photographs(), verified);
}

absl::Status Comparison::CompareSelected() {
  const bool in_sequence = options_.choice == PairChoice::kInSequence;
  ASSIGN_OR_RETURN(PairScores scores, Score());
  PairSelection selection(std::move(scores));
  std::vector<PhotographPair> pairs = GivenPairs(num_photographs(), options_);
  selection.Skip(pairs);
  const std::vector<PhotographPair> best = selection.Next(in_sequence ? kLoops : kBest);
  pairs.insert(pairs.end(), best.begin(), best.end());
  // Fewer groups or bridges: the round has joined something.
  size_t num_cuts = SIZE_MAX;
  while (!pairs.empty()) {
    RETURN_IF_ERROR(CompareAll(pairs));
    const PhotographGroups groups = Groups();
    const size_t num_left = groups.num_groups + groups.bridges.size();
    if (num_left >= num_cuts) break;
    num_cuts = num_left;
    pairs = selection.NextAtCuts(groups, kBest);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<ComparedPair>> Comparison::Run() {
  std::vector<const SfmFeatures*> features;
  for (const DatabaseImage& image : features_.images) features.push_back(&image.features);
  ASSIGN_OR_RETURN(matcher_, DescriptorMatcher::Create(backend_, features));
  const bool all = ExpectedPairs(static_cast<int64_t>(num_photographs()), options_).scored == 0;
  RETURN_IF_ERROR(all ? CompareAll(AllPairs(num_photographs())) : CompareSelected());
  return std::move(compared_);
}

}  // namespace

absl::StatusOr<std::vector<ComparedPair>> ComparePhotographs(Backend& backend,
                                                             const DatabaseFeatures& features,
                                                             const ComparisonOptions& options,
                                                             ComparisonProgressFn progress) {
  return Comparison(backend, features, options, progress).Run();
}

double ComparedDatabase::FeatureScale() const {
  int side = 1;
  for (const DatabaseCamera& camera : features.cameras) {
    side = std::max({side, camera.width, camera.height});
  }
  return std::min(1.0, feature_side / side);
}

absl::StatusOr<ComparedDatabase> CompareInDatabase(Backend& backend,
                                                   const std::filesystem::path& from,
                                                   const std::filesystem::path& to,
                                                   const ComparisonOptions& options,
                                                   ComparisonProgressFn progress) {
  ASSIGN_OR_RETURN(DatabaseFeatures read, ReadDatabaseFeatures(from));
  ComparedDatabase compared{SortedByName(std::move(read)), {}, options.feature_side};
  ASSIGN_OR_RETURN(compared.pairs,
                   ComparePhotographs(backend, compared.features, options, progress));
  RETURN_IF_ERROR(CreateDatabase(to, compared.features));
  RETURN_IF_ERROR(WritePairs(to, compared.features, compared.pairs));
  for (DatabaseImage& image : compared.features.images) image.features.descriptors = {};
  for (ComparedPair& pair : compared.pairs) pair.matches = {};
  return compared;
}

NumPairs ExpectedPairs(int64_t num_photographs, const ComparisonOptions& options) {
  const int64_t n = num_photographs, all = n * (n - 1) / 2;
  const bool in_sequence = options.choice == PairChoice::kInSequence;
  if (options.choice == PairChoice::kAll) return {0, all};
  if (!in_sequence && n <= static_cast<int64_t>(options.max_all)) return {0, all};
  // Two photographs often choose each other, so that a photograph's best pairs count about 0.7.
  const auto best = static_cast<int64_t>(in_sequence ? kLoops : kBest);
  const auto num_given = static_cast<int64_t>(GivenPairs(static_cast<size_t>(n), options).size());
  if (num_given == all) return {0, all};
  const int64_t scored =
      in_sequence ? static_cast<int64_t>(ScoredPairs(static_cast<size_t>(n), options).size()) : all;
  return {scored, std::min(all, num_given + n * best * 7 / 10)};
}

}  // namespace pepeseg
