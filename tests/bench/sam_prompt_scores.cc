#include "tests/bench/sam_prompt_scores.h"

#include <cstdio>

#include "core/base/status_macros.h"
#include "core/evaluate/entity_queries.h"
#include "core/evaluate/mask_scores.h"
#include "core/query/mask_geometry.h"
#include "core/query/prompted_thing.h"
#include "core/query/select_gaussians.h"

namespace pepeseg {
namespace {

absl::Status KeepOn() { return absl::OkStatus(); }

struct BoxIou {
  double clicked = 0, others = 0;
};

absl::StatusOr<BoxIou> ScoreBox(const Segmenter& segmenter, ImageSegmenter* images,
                                const EvaluationTask& task, const ScoredEntity& entity,
                                const BoxPrompt& box) {
  const TruthView& reference = task.views[entity.reference];
  auto thing = PromptedThing::Find(segmenter, images, {reference.view, box}, {}, KeepOn);
  if (IsNothingThere(thing.status())) return BoxIou();
  RETURN_IF_ERROR(thing.status());
  BoxIou iou;
  ASSIGN_OR_RETURN(
      SegmentResult in,
      thing->In(reference.view, {.want_similarity = true, .refine_borders = true}, KeepOn));
  CutToBox(box, in);
  iou.clicked = Iou(in.mask.pixels, reference.MaskOf(entity.name), reference.ignore);
  for (const size_t v : entity.scored) {
    const TruthView& truth = task.views[v];
    ASSIGN_OR_RETURN(const SegmentResult there,
                     thing->In(truth.view, {.refine_borders = true}, KeepOn));
    iou.others += Iou(there.mask.pixels, truth.MaskOf(entity.name), truth.ignore) /
                  static_cast<double>(entity.scored.size());
  }
  return iou;
}

// Returns the IoU of the selection of a click, rendered back, mean over the scored views.
absl::StatusOr<double> ScoreSelection(const Segmenter& segmenter, ImageSegmenter* images,
                                      const EvaluationTask& task, const ScoredEntity& entity) {
  const Prompt click = {task.views[entity.reference].view,
                        PointsPrompt{DeepestClickOf(task, entity)}};
  auto thing = PromptedThing::Find(segmenter, images, click, {}, KeepOn);
  if (IsNothingThere(thing.status())) return 0;
  RETURN_IF_ERROR(thing.status());
  const auto mask_in = [&](const ModelView& view) { return thing->In(view, {}, KeepOn); };
  ASSIGN_OR_RETURN(const GaussianSet set,
                   SelectGaussians(segmenter, {.prompt = click}, mask_in, KeepOn));
  const std::vector<int32_t> ids(set.member.begin(), set.member.end());
  double sum = 0;
  for (const size_t v : entity.scored) {
    const TruthView& truth = task.views[v];
    ASSIGN_OR_RETURN(const std::vector<int32_t> shown, segmenter.RenderIds(truth.view, ids));
    const std::vector<uint8_t> back(shown.begin(), shown.end());
    sum += Iou(back, truth.MaskOf(entity.name), truth.ignore);
  }
  return sum / static_cast<double>(entity.scored.size());
}

}  // namespace

absl::Status PrintSelections(const Segmenter& segmenter, ImageSegmenter* images,
                             const EvaluationTask& task) {
  double model = 0, both = 0;
  for (const ScoredEntity& entity : task.entities) {
    ASSIGN_OR_RETURN(const double by_model, ScoreSelection(segmenter, nullptr, task, entity));
    model += by_model;
    if (images == nullptr) continue;
    ASSIGN_OR_RETURN(const double by_both, ScoreSelection(segmenter, images, task, entity));
    both += by_both;
  }
  const auto count = static_cast<double>(task.entities.size());
  std::printf("# selections of a click, IoU: %.4f by the model", model / count);
  if (images != nullptr) std::printf(", %.4f by both", both / count);
  std::printf("\n");
  return absl::OkStatus();
}

absl::Status PrintBoxes(const Segmenter& segmenter, ImageSegmenter* images,
                        const EvaluationTask& task, bool by_entity) {
  BoxIou model, both;
  for (const ScoredEntity& entity : task.entities) {
    const TruthView& reference = task.views[entity.reference];
    int at[4];
    const std::vector<uint8_t> truth = reference.CountedMaskOf(entity.name);
    FindBox(truth, reference.view.camera.width, at);
    const BoxPrompt box = {double(at[0]), double(at[1]), double(at[2]), double(at[3])};
    ASSIGN_OR_RETURN(const BoxIou by_model, ScoreBox(segmenter, nullptr, task, entity, box));
    BoxIou by_both;
    if (images != nullptr) {
      ASSIGN_OR_RETURN(by_both, ScoreBox(segmenter, images, task, entity, box));
    }
    model.clicked += by_model.clicked, model.others += by_model.others;
    both.clicked += by_both.clicked, both.others += by_both.others;
    if (!by_entity) continue;
    std::printf("#   box %s: %.3f %.3f; %.3f %.3f", entity.name.c_str(), by_model.clicked,
                by_model.others, by_both.clicked, by_both.others);
    std::printf("\n");
  }
  const auto count = static_cast<double>(task.entities.size());
  std::printf("# boxes, IoU on the view of the box and on the others: %.4f %.4f by the model",
              model.clicked / count, model.others / count);
  if (images != nullptr) {
    std::printf(", %.4f %.4f by both", both.clicked / count, both.others / count);
  }
  std::printf("\n");
  return absl::OkStatus();
}

}  // namespace pepeseg
