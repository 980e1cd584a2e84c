// Measures "all alike" (core/find/appearance.h) on a trained model of a capture pack: how well the
// segments that are ranked by their likeness to one of several equal things are the others. One
// line for each kind of thing, such as `part:book_` or `part:*_foot`: the entities of a level of
// the truth whose names begin or end alike. An entity that no view shows by 100 pixels is left out,
// as in core/evaluate/evaluation_task.h. The mean over the kinds counts one without a segment as 0.
//
// The reference is the segment with the largest IoU with an entity, summed over the views that were
// looked at; an entity without a segment of IoU 0.5 is no reference, but still to be found. A
// segment is right if it has an IoU of 0.5 with an entity that is not found yet; the reference
// itself counts neither way. AP is the mean precision at the ranks of the right ones.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <iostream>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/find/appearance.h"
#include "core/formats/gaussian_ply.h"
#include "core/model_files/model_file.h"
#include "core/priors/sam/sam_borders.h"
#include "tests/bench/bench_backend.h"
#include "tests/bench/capture_pack.h"

namespace pepeseg {
namespace {

constexpr double kRightIou = 0.5;
constexpr int64_t kMinPixels = 100;  // of the view that shows most of an entity

absl::Status Wanted() { return absl::OkStatus(); }

// SAM's encoder in the photographs of a capture, whose pixels are those of the views.
class CaptureEncoder final : public ImageEncoder {
 public:
  CaptureEncoder(const SamBorders& sam, const Capture& capture) : sam_(sam), capture_(capture) {}

  absl::StatusOr<ImageFeatures> Encode(const ModelView& view, int width, int height,
                                       const WantedCheck&) override {
    const auto at = std::ranges::find(capture_.views, view.name, &View::name);
    ASSIGN_OR_RETURN(const SamEmbedding embedding, sam_.Embed(at->photo));
    constexpr int kCells = 64;
    ImageFeatures features;
    features.channels = static_cast<int>(embedding.values.size() / (kCells * kCells));
    features.values = embedding.values;
    const double longer = std::max(embedding.width, embedding.height);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const auto u = static_cast<int>((x + 0.5) / width * embedding.width / longer * kCells);
        const auto v = static_cast<int>((y + 0.5) / height * embedding.height / longer * kCells);
        features.cells.push_back(v * kCells + u);
      }
    }
    return features;
  }

 private:
  const SamBorders& sam_;
  const Capture& capture_;
};

// Returns the IoU of each segment with each entity of a level: [segments][entities].
std::vector<std::vector<double>> IousOf(const SceneSegments& all, const Capture& capture,
                                        const TruthLevel& level) {
  const size_t count = level.entities.size();
  std::vector<std::vector<double>> common(all.segments.size(), std::vector<double>(count));
  std::vector<double> segment_area(all.segments.size()), entity_area(count);
  for (const SeenView& seen : all.views) {
    const std::vector<uint16_t>& labels = level.labels[seen.view];
    if (labels.empty()) continue;
    const Camera& camera = capture.views[seen.view].camera;
    for (int i = 0; i < seen.width * seen.height; ++i) {
      const auto x = int64_t{2 * (i % seen.width) + 1} * camera.width / (2 * seen.width);
      const auto y = int64_t{2 * (i / seen.width) + 1} * camera.height / (2 * seen.height);
      const uint16_t entity = labels[static_cast<size_t>(y * camera.width + x)];
      entity_area[entity] += 1;
      for (const std::vector<int32_t>& shown : seen.shown) {
        if (shown[i] < 0) continue;
        segment_area[shown[i]] += 1;
        common[shown[i]][entity] += 1;
      }
    }
  }
  for (size_t s = 0; s < common.size(); ++s) {
    for (size_t e = 0; e < count; ++e) {
      common[s][e] /= std::max(1.0, segment_area[s] + entity_area[e] - common[s][e]);
    }
  }
  return common;
}

struct Ranking {
  double average_precision = 0;
  std::vector<double> precisions, recalls;  // at the minimum scores
};

// Judges the segments, best first, that are like the one of `reference`.
Ranking Judge(const std::vector<int32_t>& ranked, const std::vector<double>& scores,
              const std::vector<std::vector<double>>& ious, const std::vector<size_t>& kind,
              size_t reference, const std::vector<double>& min_scores) {
  Ranking result;
  std::set<size_t> found;
  int num_right = 0, num_ranked = 0;
  std::vector<int> num_over(min_scores.size()), num_right_over(min_scores.size());
  for (const int32_t segment : ranked) {
    const auto entity =
        std::ranges::find_if(kind, [&](size_t e) { return ious[segment][e] >= kRightIou; });
    if (entity != kind.end() && *entity == reference) continue;
    const bool right = entity != kind.end() && found.insert(*entity).second;
    ++num_ranked;
    num_right += right ? 1 : 0;
    if (right) result.average_precision += static_cast<double>(num_right) / num_ranked;
    for (size_t m = 0; m < min_scores.size(); ++m) {
      if (scores[segment] < min_scores[m]) continue;
      ++num_over[m];
      num_right_over[m] += right ? 1 : 0;
    }
  }
  const auto wanted = static_cast<double>(kind.size() - 1);
  result.average_precision /= wanted;
  for (size_t m = 0; m < min_scores.size(); ++m) {
    result.precisions.push_back(
        num_over[m] > 0 ? static_cast<double>(num_right_over[m]) / num_over[m] : 1);
    result.recalls.push_back(num_right_over[m] / wanted);
  }
  return result;
}

struct BenchOptions {
  std::string pack, gaussians, field, sam;
  std::vector<std::string> kinds;
  int num_threads = 1;
  std::vector<double> min_scores = {0.2};
};

// Returns the entities of a level whose names begin with a text, or end with it after a "*", and
// that a view of `all` shows well enough.
std::vector<size_t> EntitiesOf(const TruthLevel& level, const SceneSegments& all,
                               const std::string& text) {
  std::vector<int64_t> most(level.entities.size());
  for (const SeenView& seen : all.views) {
    std::vector<int64_t> pixels(most.size());
    for (const uint16_t entity : level.labels[seen.view]) ++pixels[entity];
    for (size_t e = 0; e < most.size(); ++e) most[e] = std::max(most[e], pixels[e]);
  }
  const bool by_end = absl::StartsWith(text, "*");
  std::vector<size_t> entities;
  for (size_t e = 0; e < level.entities.size(); ++e) {
    const std::string& name = level.entities[e];
    const bool named = by_end ? absl::EndsWith(name, text.substr(1)) : absl::StartsWith(name, text);
    if (named && most[e] >= kMinPixels) entities.push_back(e);
  }
  return entities;
}

// Prints how well a kind of thing is found, and returns its AP, if there are two of it.
absl::StatusOr<std::optional<double>> PrintKind(const Appearance& looks, const SceneSegments& all,
                                                const CapturePack& pack, const std::string& name,
                                                const std::vector<double>& min_scores) {
  const std::string level_name = name.substr(0, name.find(':'));
  const auto level = std::ranges::find(pack.truth, level_name, &TruthLevel::name);
  if (level == pack.truth.end()) return absl::NotFoundError(absl::StrCat("no level ", level_name));
  const std::vector<size_t> kind = EntitiesOf(*level, all, name.substr(name.find(':') + 1));
  if (kind.size() < 2) {
    std::printf("%s: no view shows two of them well enough\n", name.c_str());
    return std::nullopt;
  }
  const auto ious = IousOf(all, pack.capture, *level);
  double sum = 0;
  std::vector<double> precisions(min_scores.size()), recalls(min_scores.size());
  int count = 0;
  for (const size_t entity : kind) {
    const auto best = std::ranges::max_element(
        ious, {}, [&](const std::vector<double>& of) { return of[entity]; });
    if ((*best)[entity] < kRightIou) continue;
    const std::vector<double> scores =
        looks.ScoresLike({static_cast<int32_t>(best - ious.begin()), {}});
    const auto ranked = BestApart(all, scores, 0, scores.size());
    const Ranking ranking = Judge(ranked, scores, ious, kind, entity, min_scores);
    sum += ranking.average_precision;
    for (size_t m = 0; m < min_scores.size(); ++m) {
      precisions[m] += ranking.precisions[m];
      recalls[m] += ranking.recalls[m];
    }
    ++count;
  }
  const double share = 1.0 / std::max(1, count);
  std::printf("%s: %d of %zu are segments; AP %.3f; minimum:precision/recall", name.c_str(), count,
              kind.size(), share * sum);
  for (size_t m = 0; m < min_scores.size(); ++m) {
    std::printf(" %.2f:%.2f/%.2f", min_scores[m], share * precisions[m], share * recalls[m]);
  }
  std::printf("\n");
  return share * sum;
}

absl::Status Run(const BenchOptions& options) {
  ASSIGN_OR_RETURN(const CapturePack pack, ReadCapturePack(options.pack));
  const auto backend = MakeBenchBackend("cpu", options.num_threads, nullptr);
  Model model;
  ASSIGN_OR_RETURN(model.gaussians, ReadGaussianPly(options.gaussians, options.gaussians));
  ASSIGN_OR_RETURN(model.field, ReadFeatureFile(options.field, options.field));
  model.scene_radius = SceneRadius(pack.capture);
  for (const View& view : pack.capture.views) {
    model.views.push_back({view.name, view.camera, view.cam_from_world, view.held_out});
  }
  ASSIGN_OR_RETURN(const auto scene, SceneModel::Create(*backend, std::move(model)));
  SceneSegments all;
  double start = Now();
  RETURN_IF_ERROR(
      scene->Decompose(kPieceDecompositionScales, [&](const Decomposition& whole) -> absl::Status {
        std::printf("decomposed in %.2f s\n", Now() - start);
        start = Now();
        ASSIGN_OR_RETURN(all, SeeSegments(*scene, whole, kMostSeenViews, Wanted));
        return absl::OkStatus();
      }));
  std::printf("%zu segments seen in %zu views in %.2f s\n", all.segments.size(), all.views.size(),
              Now() - start);
  ASSIGN_OR_RETURN(const auto sam,
                   SamBorders::Open(options.sam, {.num_threads = options.num_threads}));
  CaptureEncoder encoder(*sam, pack.capture);
  start = Now();
  ASSIGN_OR_RETURN(const Appearance looks, Appearance::Look(*scene, all, encoder, Wanted));
  std::printf("looked at in %.2f s\n", Now() - start);
  double sum = 0;
  int count = 0;
  for (const std::string& kind : options.kinds) {
    ASSIGN_OR_RETURN(const std::optional<double> average_precision,
                     PrintKind(looks, all, pack, kind, options.min_scores));
    sum += average_precision.value_or(0);
    count += average_precision ? 1 : 0;
  }
  std::printf("mean AP of %d kinds %.3f\n", count, sum / std::max(1, count));
  return absl::OkStatus();
}

}  // namespace
}  // namespace pepeseg

// NOLINTNEXTLINE(bugprone-exception-escape): CLI11 throws only what CLI11_PARSE catches.
int main(int argc, char** argv) {
  CLI::App app("How well things that are alike are found");
  pepeseg::BenchOptions options;
  app.add_option("pack", options.pack)->required();
  app.add_option("kinds", options.kinds,
                 "LEVEL:BEGINNING or LEVEL:*END of the names of equal things")
      ->required();
  app.add_option("--gaussians", options.gaussians, "PLY that pepeseg_segment_bench has written")
      ->required();
  app.add_option("--field", options.field, "features that it has written")->required();
  app.add_option("--sam", options.sam, "folder of deploy/sam.sh")->required();
  app.add_option("--min-score", options.min_scores, "print precision and recall at these")
      ->capture_default_str();
  app.add_option("--threads", options.num_threads, "threads of the CPU")->check(CLI::Range(1, 256));
  CLI11_PARSE(app, argc, argv);
  const absl::Status status = pepeseg::Run(options);
  if (!status.ok()) std::cerr << status << "\n";
  return status.ok() ? 0 : 1;
}
