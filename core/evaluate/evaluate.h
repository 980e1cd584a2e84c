#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/evaluate/click_count.h"
#include "core/evaluate/entity_scores.h"
#include "core/evaluate/evaluation_task.h"
#include "core/evaluate/label_propagation.h"
#include "core/evaluate/mask_scores.h"
#include "core/evaluate/prompt_queries.h"
#include "core/evaluate/sam_agreement.h"
#include "core/query/segmenter.h"

// The door of this folder: callers of evaluations include this header alone.
namespace pepeseg {

// How entities are asked for and scored (METHOD.md section 5).
enum class Protocol {
  kPrompt,                  // scale and threshold chosen; "one click" where no prompt is given
  kLabelPropagation,        // clusters that correspond to those of the reference mask
  kLabelPropagationPixels,  // pixels over a fixed cosine to those clusters' centroids
  kPromptable,              // mean feature of the prompt, at a fixed cosine
  kClicks,                  // clicks until an IoU, with nothing chosen by hand
  kSamAgreement,  // best of three proposals for each of SAM's masks; reads sam_views alone
};

struct EvaluationOptions {
  Protocol protocol = Protocol::kPrompt;
  // Scales (quantiles, [0, 1]) to choose from, ascending.
  std::vector<double> scales = {0.01, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0};
  // For protocol kPrompt: thresholds (cosines, [-1, 1]) to choose from, ascending, and the
  // threshold of iou_by_scale. Other protocols have min_cosine for both.
  std::vector<double> thresholds = {0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95};
  double fixed_threshold = 0.75;
  // Refines the borders of the masks that are scored. Scales and thresholds are chosen without it,
  // and iou_by_scale is without it. Not used by kLabelPropagation, whose masks are whole clusters.
  bool refine_borders = true;
  TaskOptions task;
  LabelPropagationOptions label_propagation;  // of both protocols of label propagation
  PromptableOptions promptable;
  ClickOptions clicks = {.max_clicks = 10};
  SamAgreementOptions sam;
};
// Returns INVALID_ARGUMENT, which names the option, its value and its limits.
absl::Status Validate(const EvaluationOptions& options);

// Means over entities, each of which counts once.
struct GroupScores {
  std::string name;  // category; empty: all entities
  int num_entities = 0;
  MaskScores paper, automatic;
  // Over the entities that have a choice on their reference. Absent if none has.
  std::optional<MaskScores> reference_choice;
  std::vector<double> iou_by_scale;  // [scales]
  // Of protocol kClicks; 0 for others.
  double num_clicks = 0;
  double reached = 0;  // share of the entities, [0, 1]
  std::array<double, kNumEarlyClicks> iou_after = {};
};

struct EvaluationResult {
  std::vector<EntityScores> entities;   // by name
  std::vector<std::string> left_out;    // names of entities without a scored view
  std::vector<GroupScores> categories;  // by name
  GroupScores scene;
  int64_t num_void = 0;             // pixels of the request's views that are void, see TruthView
  std::optional<SamAgreement> sam;  // of protocol kSamAgreement, which has nothing of the above
};

// Runs a protocol on a request. Calls `check_cancelled` between queries of views, at least once for
// each entity of each view, and returns its error. Returns INVALID_ARGUMENT for the reasons of
// Validate, MakeTask and the protocol; it names the view or the entity. images: of protocol
// kClicks, may be null.
absl::StatusOr<EvaluationResult> Evaluate(const Segmenter& segmenter, EvaluationRequest request,
                                          const EvaluationOptions& options,
                                          absl::FunctionRef<absl::Status()> check_cancelled,
                                          ImageSegmenter* images = nullptr);

// Returns the error of Lpips::Open for the weights of a network for LPIPS.
absl::Status CheckLpips(const std::filesystem::path& weights);

}  // namespace pepeseg
