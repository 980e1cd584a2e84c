#include "clients/cli/benchmark_run.h"

#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "clients/cli/benchmark_pictures.h"
#include "clients/cli/benchmark_request.h"
#include "clients/cli/jobs.h"
#include "clients/cli/progress_line.h"
#include "clients/cli/shell.h"
#include "clients/cli/training.h"
#include "clients/cli/view_picture.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"

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

// Scores a scene of our own: each level of its label images by the protocol and by clicks, and the
// agreement with SAM where its masks are SAM's.
absl::Status ScoreOwnScene(const Client& client, const BenchmarkPlan& plan,
                           const BenchmarkScene& scene, const std::string& model,
                           const std::vector<v1::View>& views, ScoredRun& run) {
  for (const TruthLevel& level : scene.levels) {
    ASSIGN_OR_RETURN(v1::EvaluateModelRequest request,
                     EvaluateRequestOf(scene.folder, level, model, views));
    if (request.views().empty()) {
      return absl::InvalidArgumentError(absl::StrCat(
          level.folder.string(), ": no label image of a held-out view: looked for STEM.png"));
    }
    request.mutable_options()->set_protocol(plan.protocol);
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
  ASSIGN_OR_RETURN(v1::EvaluateModelRequest request,
                   ScoreRequest(plan.benchmark, scene, plan.protocol, views));
  request.set_model(model);
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
