#include "core/sfm/match_features.h"

#include <algorithm>
#include <string>
#include <vector>

#include "core/sfm/find_features.h"

namespace pepeseg {
namespace {

using Words = std::vector<std::string>;

bool MatchesSequentially(const MatchingTask& task, const SfmOptions& options) {
  return ComparisonFor(task.load, options).choice == PairChoice::kInSequence;
}

Words PairWords(const MatchingTask& task, const SfmOptions& options) {
  if (MatchesSequentially(task, options)) {
    return {"--SequentialMatching.overlap", std::to_string(options.sequential_overlap),
            "--SequentialMatching.quadratic_overlap", "1"};
  }
  // The matcher reports after each block, so about ten times ten blocks make a smooth progress.
  const int64_t block = std::clamp<int64_t>(task.load.num_photographs / 10, 5, 50);
  return {"--ExhaustiveMatching.block_size", std::to_string(block)};
}

}  // namespace

absl::StatusOr<ComparedDatabase> MatchByOwnFront(const MatchingTask& task,
                                                 const SfmOptions& options, Backend& backend,
                                                 SfmWatch& watch) {
  ComparisonOptions comparison = ComparisonFor(task.load, options);
  comparison.feature_side = kFeatureSide;
  comparison.num_threads = task.num_threads;
  return CompareInDatabase(backend, task.database, task.own_database, comparison,
                           [&](const ComparisonProgress& progress) {
                             if (progress.choosing) {
                               watch.progress().Score(progress.done, progress.total);
                             } else {
                               watch.progress().Compare(progress.done, progress.total);
                             }
                             return watch.ReportInTime("at matching features");
                           });
}

absl::Status MatchByColmap(const MatchingTask& task, const SfmOptions& options,
                           const ColmapProgram& program, SfmWatch& watch) {
  Words words = {"--database_path",
                 task.database.string(),
                 "--SiftMatching.use_gpu",
                 "0",
                 "--SiftMatching.num_threads",
                 ColmapThreads(task.num_threads)};
  const Words pairs = PairWords(task, options);
  words.insert(words.end(), pairs.begin(), pairs.end());
  const std::string matcher =
      MatchesSequentially(task, options) ? "sequential_matcher" : "exhaustive_matcher";
  return watch.Run(program, {matcher, words, ""});
}

std::string ColmapThreads(int num_threads) {
  return std::to_string(num_threads > 0 ? num_threads : -1);
}

}  // namespace pepeseg
