#include "clients/benchmark/suite_text.h"

#include <algorithm>
#include <set>

#include "clients/benchmark/suite_request.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

// Sets the prompt of an entity to the best thing of its name. Returns false if nothing is found.
absl::StatusOr<bool> PromptByName(const Client& client, const std::string& entity,
                                  v1::EvaluateModelRequest& request) {
  v1::FindSegmentsRequest find;
  find.set_model(request.model());
  find.set_text(entity);
  find.set_max_results(1);
  find.set_frame(request.frame());
  ASSIGN_OR_RETURN(const v1::FindSegmentsResponse answer, client.Find(find));
  if (answer.found().empty()) return false;
  (*request.mutable_prompts())[entity] = answer.found(0).prompt();
  return true;
}

// Removes the masks of entities, and views without any left.
void RemoveTruth(const std::set<std::string>& entities, v1::EvaluateModelRequest& request) {
  auto& views = *request.mutable_views();
  for (v1::ViewTruth& view : views) {
    auto& masks = *view.mutable_masks();
    masks.erase(std::remove_if(masks.begin(), masks.end(),
                               [&](const auto& mask) { return entities.contains(mask.entity()); }),
                masks.end());
  }
  views.erase(std::remove_if(views.begin(), views.end(),
                             [](const auto& view) { return view.masks().empty(); }),
              views.end());
}

// Adds the views of prompts that the request does not have, without truth.
void AddPromptViews(v1::EvaluateModelRequest& request) {
  std::set<std::string> known, missing;
  for (const v1::ViewTruth& view : request.views()) known.insert(view.view());
  for (const auto& [entity, prompt] : request.prompts()) {
    const std::string& view = prompt.view().view();
    if (!view.empty() && !known.contains(view)) missing.insert(view);
  }
  for (const std::string& view : missing) request.add_views()->set_view(view);
}

}  // namespace

absl::StatusOr<LevelScores> ScoreByText(const Client& client, const BenchmarkScene& scene,
                                        const std::string& model,
                                        const std::vector<v1::View>& views, bool refine_borders) {
  BenchmarkScene truth = scene;
  truth.prompts.clear();
  ASSIGN_OR_RETURN(
      v1::EvaluateModelRequest request,
      ScoreRequest(Benchmark::kLerfMask, truth, v1::EVALUATION_PROTOCOL_PROMPT, views));
  request.set_model(model);
  request.mutable_options()->set_refine_borders(refine_borders);
  // A prompt is no truth: its view may be one that was trained on, and is scored if it has truth.
  request.mutable_options()->set_accept_trained_views(true);
  request.mutable_options()->set_score_reference(true);
  std::vector<std::string> missing;
  for (const ReferencePrompt& prompt : scene.prompts) {
    ASSIGN_OR_RETURN(const bool found, PromptByName(client, prompt.entity, request));
    if (!found) missing.push_back(prompt.entity);
  }
  RemoveTruth({missing.begin(), missing.end()}, request);
  LevelScores scores;
  if (!request.views().empty()) {
    AddPromptViews(request);
    ASSIGN_OR_RETURN(const v1::EvaluateModelResponse response, client.Evaluate(request));
    scores = ScoresOf("", response);
  }
  // No other choice of the scale belongs to the protocol.
  scores.paper = scores.reference = {};
  for (EntityIou& entity : scores.entities) entity.paper = entity.reference = -1;
  CountMissing(missing, scores);
  return scores;
}

void CountMissing(const std::vector<std::string>& missing, LevelScores& scores) {
  const auto found = static_cast<double>(scores.num_entities);
  scores.num_entities += static_cast<int>(missing.size());
  if (missing.empty() || scores.num_entities == 0) return;
  const double share = found / scores.num_entities;
  RunScores& mean = scores.automatic;
  mean = {true, share * mean.iou, share * mean.accuracy, share * mean.boundary_iou};
  for (const std::string& entity : missing) scores.entities.push_back({entity, -1, -1, 0});
  std::ranges::sort(scores.entities, {}, &EntityIou::name);
}

}  // namespace pepeseg::client::cli
