#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "pepeseg/v1/evaluation_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"

// The measurements of a benchmark, as lines of JSON in a file that grows run by run.
namespace pepeseg::client::cli {

// Scores in [0, 1].
struct RunScores {
  bool known = false;
  double iou = 0, accuracy = 0, boundary_iou = 0;
};

// The IoU of an entity by each choice of the scale, in [0, 1]. -1: nothing was chosen so.
struct EntityIou {
  std::string name;
  double paper = -1, reference = -1, automatic = -1;
};

// The scores of one set of entities.
struct LevelScores {
  std::string name;  // level of a scene's label images; empty: the only one
  int num_entities = 0;
  std::vector<std::string> left_out;  // entities without a scored view
  RunScores paper;                    // the scale was chosen on the scored truth
  RunScores reference, automatic;     // it was chosen on the reference view, or without any truth
  std::vector<EntityIou> entities;    // by name; empty in records of earlier versions
  std::vector<double> scales, iou_by_scale;
  // Mean number of clicks and share of entities reached, by the protocol CLICKS. -1: not measured.
  double num_clicks = -1, reached = -1;
};

// One training with its scores. Numbers that were not measured are 0.
struct ScoredRun {
  std::string benchmark, scene, variant, protocol;
  int seed = 0;
  std::string options;  // preset and settings, as text: runs of other options are not mixed
  std::string device;
  double psnr = 0, ssim = 0, lpips = 0;
  std::map<std::string, double> seconds;    // wall time by stage
  double host_bytes = 0, device_bytes = 0;  // peaks of the training
  double query_ms = 0;                      // a click in a model that is in memory
  std::vector<LevelScores> levels;
  int64_t sam_masks = 0;  // masks of SAM that were clicked
  double sam_first_iou = 0, sam_best_iou = 0;
};

// Copies the scores of an evaluation. Of CLICKS only num_clicks and reached are set.
LevelScores ScoresOf(const std::string& level, const v1::EvaluateModelResponse& response);
void SetClicks(const v1::EvaluateModelResponse& response, LevelScores& level);
// Adds an agreement with SAM to that of other views, weighted by their numbers of masks.
void AddSamAgreement(const v1::EvaluateModelResponse::SamAgreement& agreement, ScoredRun& run);
// Copies times, memory and held-out scores of a model; LPIPS is the mean over the views that have
// it.
void SetModelFacts(const v1::Model& model, const std::vector<v1::View>& views, ScoredRun& run);

// The runs in a file of JSON lines.
class RunRecord {
 public:
  // Reads the file; it may be missing. A line that is cut off, by a crash, is dropped.
  // INVALID_ARGUMENT: another line is not a run.
  static absl::StatusOr<RunRecord> Open(const std::filesystem::path& file);

  // Returns true if there is a run of the same benchmark, scene, variant, protocol, seed and
  // options.
  bool Has(const ScoredRun& run) const;
  // Adds a run and writes the file.
  absl::Status Add(ScoredRun run);
  const std::vector<ScoredRun>& runs() const { return runs_; }

 private:
  std::filesystem::path file_;
  std::vector<ScoredRun> runs_;
};

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(RunScores, known, iou, accuracy, boundary_iou)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(EntityIou, name, paper, reference, automatic)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(LevelScores, name, num_entities, left_out, paper,
                                                reference, automatic, entities, scales,
                                                iou_by_scale, num_clicks, reached)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(ScoredRun, benchmark, scene, variant, protocol,
                                                seed, options, device, psnr, ssim, lpips, seconds,
                                                host_bytes, device_bytes, query_ms, levels,
                                                sam_masks, sam_first_iou, sam_best_iou)

}  // namespace pepeseg::client::cli
