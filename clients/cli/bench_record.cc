#include "clients/cli/bench_record.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/shell.h"

namespace pepeseg::client::cli {
namespace {

using Json = nlohmann::ordered_json;

// The stages of a job in the order in which they run.
constexpr const char* kStages[] = {"prepare",  "sfm",      "priors", "reconstruct",
                                   "evaluate", "features", "index"};

// Returns the mean scores of a granularity level.
Json LevelJson(const v1::EvaluateModelResponse& scores) {
  return {{"entities", scores.entities_size()},
          {"miou", scores.scene().reference().iou()},
          {"mbiou", scores.scene().reference().boundary_iou()},
          {"oracle_miou", scores.scene().paper().iou()},
          {"oracle_mbiou", scores.scene().paper().boundary_iou()}};
}

// Returns a metric of the model; 0 if it was not measured.
double MetricOf(const v1::Model& model, const std::string& name) {
  const auto found = model.metrics().find(name);
  return found == model.metrics().end() ? 0 : found->second;
}

// Returns the entry of a run in record.json.
Json RunJson(const BenchRun& run, double upload_seconds) {
  Json json = {{"name", run.name}, {"seed", run.seed}};
  Json seconds = {{"upload", upload_seconds}};
  Json core_seconds = Json::object();
  double until_click = upload_seconds;
  const auto add = [&](const std::string& what, double value) {
    seconds[what] = value;
    until_click += value;
  };
  add("queue", run.seconds.at("queue"));
  for (const std::string stage : kStages) {
    if (!run.model.metrics().contains("seconds_" + stage)) continue;
    add(stage, MetricOf(run.model, "seconds_" + stage));
    core_seconds[stage] = MetricOf(run.model, "core_seconds_" + stage);
  }
  // The rest is spent between the stages: starting the worker, storing its result.
  add("between", run.seconds.at("request_to_model") - (until_click - upload_seconds));
  if (const auto click = run.seconds.find("first_click"); click != run.seconds.end()) {
    add("first_click", click->second);
    seconds["request_to_click"] = until_click;
    seconds["next_click"] = run.seconds.at("next_click");
  }
  json["seconds"] = seconds;
  json["core_seconds"] = core_seconds;
  json["steps"] = run.steps;
  json["psnr"] = MetricOf(run.model, "psnr");
  json["ssim"] = MetricOf(run.model, "ssim");
  json["num_gaussians"] = run.model.num_gaussians();
  json["num_bytes"] = run.model.num_bytes();
  json["peak_memory_bytes"] = MetricOf(run.model, "peak_memory_bytes");
  json["peak_device_bytes"] = MetricOf(run.model, "peak_device_bytes");
  Json levels = Json::object();
  for (const auto& [name, scores] : run.levels) levels[name] = LevelJson(scores);
  json["levels"] = levels;
  return json;
}

}  // namespace

Json ToJson(const BenchRecord& record) {
  Json json = {{"record", "pepeseg bench"}, {"dataset", record.dataset}};
  for (const auto& [name, value] : record.facts) json[name] = value;
  Json options = Json::object(), runs = Json::array();
  for (const BenchRun& run : record.runs) {
    json["device"] = run.model.device();
    if (!options.contains(run.name)) {
      options[run.name] = Json::parse(ToJson(run.job.effective_options()), nullptr, false);
    }
    runs.push_back(RunJson(run, record.upload_seconds));
  }
  json["options"] = options;
  json["runs"] = runs;
  return json;
}

std::string RunLine(const BenchRun& run) {
  std::string line =
      absl::StrFormat("%s, seed %d: %.1f s, %.2f dB, SSIM %.4f, %d Gaussians", run.name, run.seed,
                      run.seconds.at("request_to_model"), MetricOf(run.model, "psnr"),
                      MetricOf(run.model, "ssim"), run.model.num_gaussians());
  for (const auto& [name, scores] : run.levels) {
    absl::StrAppendFormat(&line, ", %s %.1f / %.1f", name, 100 * scores.scene().reference().iou(),
                          100 * scores.scene().reference().boundary_iou());
  }
  return line;
}

}  // namespace pepeseg::client::cli
