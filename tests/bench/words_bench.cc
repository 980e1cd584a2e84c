// Finds everyday words in a trained scene with ground truth (tests/bench/results/words.md):
//
//   pepeseg_words_bench --pack SCENE.pack --ply MODEL.ply --field FEATURES --detector FOLDER
//     --thing apple=labels/1 --thing cup=object/mug ...
//
// --thing names a word and an entity of a level of the truth that it means, by name or number.
// Prints each thing that is found of any word, with its score and the entity that its segment shows
// best, then precision and recall by word.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <iostream>
#include <map>
#include <set>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "core/find/scene_segments.h"
#include "core/find/word_votes.h"
#include "core/formats/gaussian_ply.h"
#include "core/model_files/model_file.h"
#include "core/priors/detect/detector.h"
#include "core/query/scene_model.h"
#include "tests/bench/bench_backend.h"
#include "tests/bench/capture_pack.h"

namespace pepeseg {
namespace {

struct BenchOptions {
  std::string pack, ply, field, detector;
  std::vector<std::string> things;
  double min_score = 0.29, min_iou = 0.5;
  int tiles = 2, threads = 2;
};

// An entity: its level and its number in the level.
using Entity = std::pair<size_t, int>;

std::string NameOf(const CapturePack& pack, const Entity& entity) {
  const TruthLevel& level = pack.truth[entity.first];
  const auto number = static_cast<size_t>(entity.second);
  return absl::StrCat(
      level.name, "/",
      number < level.entities.size() ? level.entities[number] : absl::StrCat(number));
}

// What the grids of the views show of segments and entities.
class Shown {
 public:
  Shown(const CapturePack& pack, const SceneSegments& scene) {
    for (size_t l = 0; l < pack.truth.size(); ++l) {
      for (const SeenView& seen : scene.views) {
        const std::vector<uint16_t>& labels = pack.truth[l].labels[seen.view];
        if (labels.empty()) continue;
        Add(l, labels, pack.capture.views[seen.view].camera, seen);
      }
    }
  }

  // Returns the entity that a segment shows best, and the IoU. `among`: those that are asked;
  // empty: all.
  std::pair<Entity, double> BestOf(int32_t segment, const std::set<Entity>& among) const {
    std::pair<Entity, double> best = {{0, 0}, 0};
    for (const auto& [key, shared] : shared_) {
      if (key.second != segment || key.first.second == 0) continue;
      if (!among.empty() && !among.contains(key.first)) continue;
      const int64_t all =
          entities_.at(key.first) + segments_.at({key.first.first, segment}) - shared;
      const double iou = static_cast<double>(shared) / static_cast<double>(all);
      if (iou > best.second) best = {key.first, iou};
    }
    return best;
  }

  const std::map<Entity, int64_t>& entities() const { return entities_; }

 private:
  void Add(size_t l, const std::vector<uint16_t>& labels, const Camera& camera,
           const SeenView& seen) {
    for (int y = 0; y < seen.height; ++y) {
      const int64_t from_y = int64_t{2 * y + 1} * camera.height / (2 * seen.height);
      for (int x = 0; x < seen.width; ++x) {
        const int64_t from_x = int64_t{2 * x + 1} * camera.width / (2 * seen.width);
        const Entity entity = {l, labels[from_y * camera.width + from_x]};
        ++entities_[entity];
        for (const std::vector<int32_t>& level : seen.shown) {
          const int32_t segment = level[size_t{1} * y * seen.width + x];
          if (segment < 0) continue;
          ++segments_[{l, segment}];
          ++shared_[{entity, segment}];
        }
      }
    }
  }

  std::map<Entity, int64_t> entities_;
  std::map<std::pair<size_t, int32_t>, int64_t> segments_;  // by level of the truth
  std::map<std::pair<Entity, int32_t>, int64_t> shared_;
};

absl::StatusOr<std::map<std::string, std::set<Entity>>> ReadThings(const CapturePack& pack,
                                                                   const Shown& shown,
                                                                   const BenchOptions& options) {
  std::map<std::string, std::set<Entity>> meant;
  for (const std::string& thing : options.things) {
    const size_t split = thing.find('=');
    const std::string name = split == std::string::npos ? "" : thing.substr(split + 1);
    bool known = false;
    for (const auto& [entity, pixels] : shown.entities()) {
      if (NameOf(pack, entity) != name) continue;
      meant[thing.substr(0, split)].insert(entity);
      known = true;
    }
    if (!known) return absl::NotFoundError(absl::StrCat(thing, ": no view shows such an entity"));
  }
  return meant;
}

absl::StatusOr<std::vector<std::vector<Sighting>>> SightAll(const Detector& detector,
                                                            const CapturePack& pack,
                                                            const SceneSegments& scene) {
  std::vector<std::vector<Sighting>> sightings;
  const absl::Time begin = absl::Now();
  for (const SeenView& seen : scene.views) {
    const Image& photo = pack.capture.views[seen.view].photo;
    ASSIGN_OR_RETURN(const auto boxes, detector.Detect(photo));
    const auto width = static_cast<float>(photo.width), height = static_cast<float>(photo.height);
    auto& in_view = sightings.emplace_back();
    for (const DetectedBox& box : boxes) {
      in_view.push_back(
          {box.word, box.score, box.x0 / width, box.y0 / height, box.x1 / width, box.y1 / height});
    }
  }
  std::printf("%zu views detected in %.1f s\n", scene.views.size(),
              absl::ToDoubleSeconds(absl::Now() - begin));
  return sightings;
}

absl::StatusOr<SceneSegments> SeeScene(Backend& backend, const CapturePack& pack,
                                       const BenchOptions& options) {
  Model model;
  ASSIGN_OR_RETURN(model.gaussians, ReadGaussianPly(options.ply, options.ply));
  ASSIGN_OR_RETURN(model.field, ReadFeatureFile(options.field, options.field));
  model.scene_radius = SceneRadius(pack.capture);
  for (const View& view : pack.capture.views) {
    model.views.push_back({view.name, view.camera, view.cam_from_world, view.held_out});
  }
  ASSIGN_OR_RETURN(const auto loaded, SceneModel::Create(backend, std::move(model)));
  SceneSegments scene;
  RETURN_IF_ERROR(loaded->Decompose(
      kPieceDecompositionScales, [&](const Decomposition& decomposition) -> absl::Status {
        ASSIGN_OR_RETURN(scene, SeeSegments(*loaded, decomposition, kMostSeenViews,
                                            [] { return absl::OkStatus(); }));
        return absl::OkStatus();
      }));
  return scene;
}

struct WordScore {
  int found = 0, right = 0;
  std::set<Entity> reached;
};

// Prints the things of a word, and returns how many are right. Those that are unsure are printed,
// too, down to half of the minimum.
WordScore ScoreWord(const std::string& name, std::span<const SegmentWord> things,
                    const std::set<Entity>& entities, const CapturePack& pack, const Shown& shown,
                    const BenchOptions& options) {
  WordScore score;
  for (const SegmentWord& thing : things) {
    if (thing.score < options.min_score / 2) continue;
    const bool sure = thing.score >= options.min_score;
    auto [entity, iou] = shown.BestOf(thing.segment, entities);
    const bool right =
        !entities.empty() && iou >= options.min_iou && !score.reached.contains(entity);
    if (!right) std::tie(entity, iou) = shown.BestOf(thing.segment, {});
    if (sure) {
      ++score.found;
      score.right += right;
      if (right) score.reached.insert(entity);
    }
    std::printf("  %-6s %-13s %.3f  %s, IoU %.2f\n",
                !sure   ? "unsure"
                : right ? "right"
                        : "WRONG",
                name.c_str(), thing.score, NameOf(pack, entity).c_str(), iou);
  }
  if (score.found > 0 || !entities.empty()) {
    std::printf("%-13s precision %d/%d  recall %zu/%zu\n", name.c_str(), score.right, score.found,
                score.reached.size(), entities.size());
  }
  return score;
}

absl::Status Run(const BenchOptions& options) {
  ASSIGN_OR_RETURN(const CapturePack pack, ReadCapturePack(options.pack));
  const auto backend = MakeBenchBackend("cpu", options.threads, nullptr);
  ASSIGN_OR_RETURN(const SceneSegments scene, SeeScene(*backend, pack, options));
  ASSIGN_OR_RETURN(const auto detector,
                   Detector::Load(options.detector, {options.threads, options.tiles}));
  ASSIGN_OR_RETURN(const auto sightings, SightAll(*detector, pack, scene));
  const auto num_words = static_cast<int>(detector->words().size());
  const std::vector<SegmentWord> words = VoteWords(scene, sightings, num_words);
  const Shown shown(pack, scene);
  ASSIGN_OR_RETURN(auto meant, ReadThings(pack, shown, options));
  WordScore all;
  for (int word = 0; word < num_words; ++word) {
    const std::string& name = detector->words()[word];
    const WordScore score =
        ScoreWord(name, ThingsOfWord(scene, words, word), meant[name], pack, shown, options);
    all.found += score.found;
    all.right += score.right;
  }
  std::printf("all words: precision %d/%d\n", all.right, all.found);
  return absl::OkStatus();
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  pepeseg::BenchOptions options;
  CLI::App app("Finds everyday words in a trained scene with ground truth.");
  app.add_option("--pack", options.pack, "capture with truth (pepeseg_pack_capture)")->required();
  app.add_option("--ply", options.ply, "Gaussians")->required();
  app.add_option("--field", options.field, "features")->required();
  app.add_option("--detector", options.detector, "folder of deploy/detector.sh")->required();
  app.add_option("--thing", options.things, "WORD=LEVEL/ENTITY");
  app.add_option("--min-score", options.min_score);
  app.add_option("--tiles", options.tiles);
  app.add_option("--threads", options.threads);
  CLI11_PARSE(app, argc, argv);
  const absl::Status status = pepeseg::Run(options);
  if (!status.ok()) std::cerr << status << "\n";
  return status.ok() ? 0 : 1;
}
