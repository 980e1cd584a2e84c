#include "tests/bench/protocol_scores.h"

#include <cstdio>
#include <utility>

#include "core/base/status_macros.h"
#include "core/evaluate/evaluate.h"
#include "tests/bench/bench_backend.h"

namespace pepeseg {
namespace {

// Gives each entity its own mask as the prompt, in the view that would be its reference anyway.
absl::Status PromptByOwnMask(EvaluationRequest& request, const TaskOptions& options) {
  ASSIGN_OR_RETURN(const EvaluationTask task, MakeTask(request, options));
  for (const ScoredEntity& entity : task.entities) {
    request.prompts.push_back({entity.name, task.views[entity.reference].view.name, OwnMask{}});
  }
  return absl::OkStatus();
}

void PrintChoice(const char* choice, const MaskScores& scores) {
  std::printf(" %s %.4f %.4f %.4f;", choice, scores.iou, scores.accuracy, scores.boundary_iou);
}

absl::Status PrintProtocol(const Segmenter& segmenter, EvaluationRequest request,
                           const EvaluationOptions& options, const std::string& name) {
  const double start = Now();
  ASSIGN_OR_RETURN(const EvaluationResult result, Evaluate(segmenter, std::move(request), options,
                                                           [] { return absl::OkStatus(); }));
  const GroupScores& scene = result.scene;
  std::printf("# %s:", name.c_str());
  if (options.protocol == Protocol::kClicks) {
    std::printf(" NoC@90 %.2f, %.1f %% reached, IoU after 1, 2, 3 clicks %.4f %.4f %.4f;",
                scene.num_clicks, 100 * scene.reached, scene.iou_after[0], scene.iou_after[1],
                scene.iou_after[2]);
  } else {
    int num_missing = 0;
    for (const EntityScores& entity : result.entities) num_missing += entity.missing ? 1 : 0;
    PrintChoice("paper", scene.paper);
    if (scene.reference_choice) PrintChoice("reference", *scene.reference_choice);
    PrintChoice("automatic", scene.automatic);
    std::printf(" by scale");
    for (const double iou : scene.iou_by_scale) std::printf(" %.3f", iou);
    std::printf("; %d missing;", num_missing);
  }
  std::printf(" %d entities, %.1f s\n", scene.num_entities, Now() - start);
  return absl::OkStatus();
}

}  // namespace

absl::Status PrintProtocols(const Segmenter& segmenter, const std::vector<TruthView>& views,
                            const std::string& name) {
  EvaluationRequest clicked;
  clicked.views = views;
  EvaluationOptions options;
  EvaluationRequest masked = clicked;
  RETURN_IF_ERROR(PromptByOwnMask(masked, options.task));
  RETURN_IF_ERROR(PrintProtocol(segmenter, clicked, options, name + " one click"));
  RETURN_IF_ERROR(PrintProtocol(segmenter, masked, options, name + " mask"));
  options.protocol = Protocol::kLabelPropagation;
  RETURN_IF_ERROR(PrintProtocol(segmenter, masked, options, name + " label propagation"));
  options.protocol = Protocol::kLabelPropagationPixels;
  RETURN_IF_ERROR(PrintProtocol(segmenter, masked, options, name + " label propagation, pixels"));
  options.protocol = Protocol::kPromptable;
  RETURN_IF_ERROR(PrintProtocol(segmenter, masked, options, name + " promptable"));
  options.protocol = Protocol::kClicks;
  return PrintProtocol(segmenter, clicked, options, name + " clicks");
}

absl::Status PrintMaskAgreement(const Segmenter& segmenter, const Capture& capture) {
  EvaluationRequest request;
  for (const View& view : capture.views) {
    if (!view.held_out || view.masks.empty()) continue;
    SamView& sam = request.sam_views.emplace_back();
    sam.view = {view.name, view.camera, view.cam_from_world, view.held_out};
    sam.masks = view.masks;
    sam.ignore = view.ignore;
  }
  if (request.sam_views.empty()) return absl::OkStatus();
  EvaluationOptions options;
  options.protocol = Protocol::kSamAgreement;
  const double start = Now();
  ASSIGN_OR_RETURN(const EvaluationResult result, Evaluate(segmenter, std::move(request), options,
                                                           [] { return absl::OkStatus(); }));
  std::printf("# agreement with masks: best of three %.4f, first %.4f; %ld masks, %.1f s\n",
              result.sam->best_iou, result.sam->first_iou, static_cast<long>(result.sam->num_masks),
              Now() - start);
  return absl::OkStatus();
}

}  // namespace pepeseg
