#include "clients/benchmark/suite_run.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "clients/benchmark/evaluation_truth.h"
#include "clients/benchmark/suite_request.h"
#include "clients/benchmark/suite_text.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/picture.h"
#include "clients/terminal/progress_line.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/training_run.h"
#include "clients/terminal/view_picture.h"

namespace pepeseg::client::cli {
namespace {

// Trains a model and returns it.
absl::StatusOr<v1::Model> TrainScene(const Client& client, const BenchmarkPlan& plan,
                                     const std::vector<std::string>& settings,
                                     const std::string& dataset) {
  std::vector<std::string> all = plan.settings;
  all.insert(all.end(), settings.begin(), settings.end());
  ASSIGN_OR_RETURN(const v1::Job job, StartTraining(client, SceneOf(dataset), dataset, all));
  ASSIGN_OR_RETURN(const v1::Job ended, WatchJob(client, job.name(), [](const v1::JobEvent&) {}));
  return client.GetModel(ended.model());
}

// Returns the milliseconds of a click in the middle of the first held-out view, of a model that is
// in memory; 0 if nothing is under the click.
absl::StatusOr<double> QueryMilliseconds(const Client& client, const std::string& model,
                                         const std::vector<v1::View>& views) {
  v1::SegmentViewsRequest request;
  request.set_model(model);
  for (const v1::View& view : views) {
    if (!view.held_out()) continue;
    const PixelSize photograph = PhotographSize(view);
    request.mutable_prompt()->mutable_view()->set_view(view.view());
    auto* point = request.mutable_prompt()->mutable_points()->add_points();
    point->set_x(0.5 * photograph.width);
    point->set_y(0.5 * photograph.height);
    break;
  }
  double milliseconds = 0;
  for (int i = 0; i < 2; ++i) {  // the first one loads the model
    const Stopwatch watch;
    const auto answer = client.Segment(request);
    if (absl::IsFailedPrecondition(answer.status())) return 0;
    RETURN_IF_ERROR(answer.status());
    milliseconds = 1e3 * watch.Seconds();
  }
  return milliseconds;
}

constexpr size_t kMaxPictures = 3;
constexpr Rgb kTruth{60, 255, 60};

using ScoredEntity = v1::EvaluateModelResponse::Entity;

// Returns the mask of an entity in a view of the request; null if it has none.
const v1::MaskImage* TruthMask(const v1::EvaluateModelRequest& request, const std::string& view,
                               const std::string& entity) {
  for (const v1::ViewTruth& truth : request.views()) {
    if (truth.view() != view) continue;
    for (const v1::EntityMask& mask : truth.masks()) {
      if (mask.entity() == entity) return &mask.mask();
    }
  }
  return nullptr;
}

// Returns the entity's prompt as SegmentViews takes it; nothing if it has none.
std::optional<v1::Prompt> PromptOf(const v1::EvaluateModelRequest& request,
                                   const ScoredEntity& entity) {
  const auto given = request.prompts().find(entity.name());
  if (given != request.prompts().end()) return given->second;
  v1::Prompt prompt;
  prompt.mutable_view()->set_view(entity.reference_view());
  const v1::MaskImage* own = TruthMask(request, entity.reference_view(), entity.name());
  if (request.own_masks().contains(entity.name()) && own != nullptr) *prompt.mutable_mask() = *own;
  for (const auto& click : entity.clicks()) {
    auto& point = *prompt.mutable_points()->add_points();
    point.set_x(click.x());
    point.set_y(click.y());
    point.set_negative(click.negative());
  }
  if (prompt.what_case() == v1::Prompt::WHAT_NOT_SET) return std::nullopt;
  return prompt;
}

// Returns the scored view with the lowest IoU; "" if none is scored.
std::string WorstView(const ScoredEntity& entity) {
  const auto& scores = entity.automatic().views();
  if (scores.empty() || scores.size() != entity.views_size()) return "";
  const auto worst = std::min_element(
      scores.begin(), scores.end(), [](const auto& a, const auto& b) { return a.iou() < b.iou(); });
  return entity.views(static_cast<int>(worst - scores.begin())).view();
}

absl::Status DrawEntity(const Client& client, const v1::EvaluateModelRequest& request,
                        const ScoredEntity& entity, const std::filesystem::path& prefix) {
  const std::optional<v1::Prompt> prompt = PromptOf(request, entity);
  const std::string view = WorstView(entity);
  if (!prompt || view.empty()) return absl::OkStatus();
  v1::SegmentViewsRequest segment;
  segment.set_model(request.model());
  *segment.mutable_prompt() = *prompt;
  segment.mutable_targets()->add_views(view);
  const auto answer = client.Segment(segment);
  if (absl::IsFailedPrecondition(answer.status())) return absl::OkStatus();  // nothing is there
  RETURN_IF_ERROR(answer.status());
  const Overlay overlay{answer->masks(0), {}, v1::PIXEL_FRAME_PHOTOGRAPH};
  ASSIGN_OR_RETURN(Picture picture, DrawnOver(client, request.model(), overlay));
  if (const v1::MaskImage* truth = TruthMask(request, view, entity.name()); truth != nullptr) {
    ASSIGN_OR_RETURN(const Picture mask, DecodePicture(truth->png(), view));
    GreyPicture grey{mask.width, mask.height, {}};
    for (size_t i = 0; i < mask.pixels.size(); i += 3) grey.pixels.push_back(mask.pixels[i]);
    DrawOutline(picture, Resized(grey, picture.width, picture.height).pixels, kTruth);
  }
  return WritePng(
      absl::StrCat(prefix.string(), "-", Stem(entity.name() + ".png"), "-", Stem(view), ".png"),
      picture);
}

// Draws the worst entities of an evaluation, those with the lowest IoU without any truth, at most
// 3: PREFIX-ENTITY-VIEW.png, the scored view with the lowest IoU, has the outline of the truth
// (green) and what SegmentViews answers to the entity's prompt, with the scale chosen by the server
// (orange). That answer may differ from what the protocol scores. Entities whose prompt is a label
// or a mean of points, and prompts with nothing under them, are left out.
absl::Status DrawWorst(const Client& client, const v1::EvaluateModelRequest& request,
                       const v1::EvaluateModelResponse& response,
                       const std::filesystem::path& prefix) {
  std::vector<const ScoredEntity*> entities;
  for (const ScoredEntity& entity : response.entities()) entities.push_back(&entity);
  std::stable_sort(entities.begin(), entities.end(),
                   [](const ScoredEntity* a, const ScoredEntity* b) {
                     return a->automatic().mean().iou() < b->automatic().mean().iou();
                   });
  for (size_t i = 0; i < std::min(entities.size(), kMaxPictures); ++i) {
    RETURN_IF_ERROR(DrawEntity(client, request, *entities[i], prefix));
  }
  return absl::OkStatus();
}

// Scores a scene of our own: each level of its label images by the protocol and by clicks, and the
// agreement with SAM where its masks are SAM's.
absl::Status ScoreOwnScene(const Client& client, const BenchmarkPlan& plan,
                           const BenchmarkScene& scene, const std::string& model,
                           const std::vector<v1::View>& views, ScoredRun& run) {
  for (const TruthLevel& level : scene.levels) {
    ASSIGN_OR_RETURN(v1::EvaluateModelRequest request,
                     EvaluateRequestOf(scene.folder, level, model, views));
    if (request.views().empty()) {
      return absl::InvalidArgumentError(
          absl::StrCat(level.folder.string(),
                       ": no truth of a held-out view: looked for STEM.png and outlines"));
    }
    request.mutable_options()->set_protocol(plan.protocol);
    request.mutable_options()->set_refine_borders(plan.refine_borders);
    ASSIGN_OR_RETURN(const v1::EvaluateModelResponse scores, client.Evaluate(request));
    LevelScores& added = run.levels.emplace_back(ScoresOf(level.name, scores));
    request.mutable_options()->set_protocol(v1::EVALUATION_PROTOCOL_CLICKS);
    ASSIGN_OR_RETURN(const v1::EvaluateModelResponse clicks, client.Evaluate(request));
    SetClicks(clicks, added);
  }
  ASSIGN_OR_RETURN(auto sam, SamRequests(scene, views));
  for (v1::EvaluateModelRequest& request : sam) {
    request.set_model(model);
    ASSIGN_OR_RETURN(const v1::EvaluateModelResponse agreement, client.Evaluate(request));
    AddSamAgreement(agreement.sam_agreement(), run);
  }
  return absl::OkStatus();
}

absl::Status ScoreScene(const Client& client, const BenchmarkPlan& plan,
                        const BenchmarkScene& scene, const std::string& model,
                        const std::vector<v1::View>& views, ScoredRun& run) {
  if (plan.benchmark == Benchmark::kScene) {
    return ScoreOwnScene(client, plan, scene, model, views, run);
  }
  if (plan.by_text) {
    ASSIGN_OR_RETURN(LevelScores scores,
                     ScoreByText(client, scene, model, views, plan.refine_borders));
    run.levels.push_back(std::move(scores));
    return absl::OkStatus();
  }
  ASSIGN_OR_RETURN(v1::EvaluateModelRequest request,
                   ScoreRequest(plan.benchmark, scene, plan.protocol, views));
  request.set_model(model);
  request.mutable_options()->set_refine_borders(plan.refine_borders);
  ASSIGN_OR_RETURN(const v1::EvaluateModelResponse scores, client.Evaluate(request));
  run.levels.push_back(ScoresOf("", scores));
  if (plan.pictures.empty()) return absl::OkStatus();
  return DrawWorst(client, request, scores, plan.pictures / absl::StrCat(run.scene, "-", run.seed));
}

}  // namespace

absl::Status RunScene(const Client& client, const BenchmarkPlan& plan, const BenchmarkScene& scene,
                      const BenchmarkVariant& variant, const std::string& dataset, ScoredRun& run) {
  std::vector<std::string> settings = variant.settings;
  settings.push_back(absl::StrCat("reconstruct.seed=", run.seed));
  settings.push_back(absl::StrCat("features.seed=", run.seed));
  for (const std::string& view : HeldOutViews(scene)) {
    settings.push_back("import.held_out_views=" + view);
  }
  ASSIGN_OR_RETURN(const v1::Model model, TrainScene(client, plan, settings, dataset));
  ASSIGN_OR_RETURN(const std::vector<v1::View> views, client.ListViews(model.name()));
  SetModelFacts(model, views, run);
  ASSIGN_OR_RETURN(run.query_ms, QueryMilliseconds(client, model.name(), views));
  RETURN_IF_ERROR(ScoreScene(client, plan, scene, model.name(), views, run));
  return plan.keep_models ? absl::OkStatus() : client.DeleteModel(model.name());
}

}  // namespace pepeseg::client::cli
