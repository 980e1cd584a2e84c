// The verb "curves": trains a dataset with several lengths, presets and seeds, and scores each
// model.
#include "clients/benchmark/curves.h"

#include <filesystem>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "clients/benchmark/evaluation_truth.h"
#include "clients/benchmark/verbs.h"
#include "clients/cpp/dataset_folder.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/model_summary.h"
#include "clients/terminal/progress_line.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/text_table.h"
#include "clients/terminal/training_run.h"
#include "clients/terminal/view_picture.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct BenchFlags {
  std::string folder;  // of the dataset
  std::string out;     // folder for record.json
  std::string scene;   // "": a new one
  std::vector<std::string> presets{"preview", "standard", "best"};
  std::vector<int> steps{500, 1000, 2000, 5000};
  int num_seeds = 3;  // each plan is trained with seeds 1 to this
  std::string image_scale;
  std::string depth_kind = "depth";
  bool photographs_alone = false;     // the server makes poses, masks and depth
  std::vector<std::string> settings;  // NAME=VALUE, of every training
  std::vector<std::string> facts;     // NAME=VALUE, copied to the record
};

// A training, apart from its seed.
struct Plan {
  std::string name;
  std::vector<std::string> settings;
};

// Returns a plan for each number of steps, then one for each preset.
std::vector<Plan> PlansOf(const BenchFlags& flags) {
  std::vector<std::string> shared = flags.settings;
  if (!flags.image_scale.empty()) shared.push_back("import.image_scale=" + flags.image_scale);
  std::vector<Plan> plans;
  for (const int steps : flags.steps) {
    plans.push_back({absl::StrCat(steps, " steps"),
                     {absl::StrCat("reconstruct.num_steps=", steps),
                      absl::StrCat("features.num_steps=", steps)}});
  }
  for (const std::string& preset : flags.presets) plans.push_back({preset, {"preset=" + preset}});
  for (Plan& plan : plans) {
    plan.settings.insert(plan.settings.end(), shared.begin(), shared.end());
  }
  return plans;
}

// Trains `plan` with the seed of `run` and waits for the model.
absl::Status Train(const Client& client, const std::string& dataset, const Plan& plan,
                   BenchRun& run) {
  std::vector<std::string> settings = plan.settings;
  settings.push_back(absl::StrCat("reconstruct.seed=", run.seed));
  settings.push_back(absl::StrCat("features.seed=", run.seed));
  const Stopwatch watch;
  ASSIGN_OR_RETURN(const v1::Job job, StartTraining(client, SceneOf(dataset), dataset, settings));
  ASSIGN_OR_RETURN(run.job, WatchJob(client, job.name(), [&](const v1::JobEvent& event) {
                     if (!event.has_progress()) return;
                     run.steps[WordOf(event.progress().stage())] = event.progress().step();
                   }));
  run.seconds["request_to_model"] = watch.Seconds();
  run.seconds["queue"] =
      absl::ToDoubleSeconds(ToTime(run.job.start_time()) - ToTime(run.job.create_time()));
  ASSIGN_OR_RETURN(run.model, client.GetModel(run.job.model()));
  return absl::OkStatus();
}

// Measures two clicks in the middle of the first held-out view, at the granularity that the server
// chooses. The first one loads the model. Measures nothing if nothing is under the click.
absl::Status Click(const Client& client, const std::vector<v1::View>& views, BenchRun& run) {
  v1::SegmentViewsRequest request;
  request.set_model(run.model.name());
  for (const v1::View& view : views) {
    if (!view.held_out()) continue;
    request.mutable_prompt()->mutable_view()->set_view(view.view());
    request.mutable_targets()->add_views(view.view());
    auto* point = request.mutable_prompt()->mutable_points()->add_points();
    const PixelSize photograph = PhotographSize(view);
    point->set_x(0.5 * photograph.width);
    point->set_y(0.5 * photograph.height);
    break;
  }
  for (const char* name : {"first_click", "next_click"}) {
    const Stopwatch watch;
    const auto answer = client.Segment(request);
    if (absl::IsFailedPrecondition(answer.status())) return absl::OkStatus();
    RETURN_IF_ERROR(answer.status());
    run.seconds[name] = watch.Seconds();
  }
  return absl::OkStatus();
}

// Scores the model against the label images of each level.
absl::Status Score(const Client& client, const fs::path& dataset,
                   const std::vector<TruthLevel>& truth, const std::vector<v1::View>& views,
                   BenchRun& run) {
  for (const TruthLevel& level : truth) {
    ASSIGN_OR_RETURN(const v1::EvaluateModelRequest request,
                     EvaluateRequestOf(dataset, level, run.model.name(), views));
    ASSIGN_OR_RETURN(v1::EvaluateModelResponse scores, client.Evaluate(request));
    run.levels.emplace_back(level.name, std::move(scores));
  }
  return absl::OkStatus();
}

// Trains, measures and scores one model, and deletes it.
absl::StatusOr<BenchRun> RunPlan(const Client& client, const BenchFlags& flags,
                                 const std::string& dataset, const Plan& plan, uint64_t seed) {
  BenchRun run;
  run.name = plan.name;
  run.seed = seed;
  RETURN_IF_ERROR(Train(client, dataset, plan, run));
  ASSIGN_OR_RETURN(const std::vector<v1::View> views, client.ListViews(run.model.name()));
  ASSIGN_OR_RETURN(const std::vector<TruthLevel> truth, FindTruth(flags.folder));
  // A model that was trained without masks cannot segment.
  const std::string& masks = run.model.sources().masks();
  if (!masks.empty() && masks != "none") {
    RETURN_IF_ERROR(Click(client, views, run));
    RETURN_IF_ERROR(Score(client, flags.folder, truth, views, run));
  }
  RETURN_IF_ERROR(client.DeleteModel(run.model.name()));
  return run;
}

absl::Status RunBench(const Shell& shell, const BenchFlags& flags) {
  const Client client(shell.channel);
  const std::string scene = SceneName(
      flags.scene.empty() ? absl::StrCat("bench-", absl::ToUnixMillis(absl::Now())) : flags.scene);
  BenchRecord record;
  record.dataset = fs::absolute(flags.folder).lexically_normal().filename().string();
  for (const std::string& fact : flags.facts) {
    const std::pair<std::string, std::string> split = absl::StrSplit(fact, absl::MaxSplits('=', 1));
    record.facts.insert(split);
  }
  const fs::path record_file = fs::path(flags.out) / "record.json";
  // Fail before the trainings, not after them, if the record cannot be written.
  RETURN_IF_ERROR(OutputFile::Create(record_file).status());
  const Stopwatch watch;
  ASSIGN_OR_RETURN(DatasetFolder folder,
                   ReadDatasetFolder(flags.folder, DepthKind(flags.depth_kind)));
  if (flags.photographs_alone) {
    std::erase_if(folder.files, [](const FolderFile& file) {
      return file.kind != v1::FILE_KIND_IMAGE && file.kind != v1::FILE_KIND_VIDEO;
    });
  }
  RETURN_IF_ERROR(client.EnsureScene(scene));
  ASSIGN_OR_RETURN(const v1::Dataset dataset, UploadFolder(client, scene, folder));
  record.upload_seconds = watch.Seconds();
  for (const Plan& plan : PlansOf(flags)) {
    for (int seed = 1; seed <= flags.num_seeds; ++seed) {
      ASSIGN_OR_RETURN(BenchRun run, RunPlan(client, flags, dataset.name(), plan, seed));
      if (!shell.json) Print(RunLine(run));
      record.runs.push_back(std::move(run));
      // Write after each run, so that its measurements are kept if a later run fails.
      RETURN_IF_ERROR(WriteFile(record_file, ToJson(record).dump(1) + "\n"));
    }
  }
  if (shell.json) Print(ToJson(record).dump());
  return absl::OkStatus();
}

// The stages of a job.
constexpr const char* kStages[] = {"prepare", "sfm",      "reconstruct", "evaluate",
                                   "priors",  "features", "index"};

// Returns the mean scores of a granularity level.
Json LevelJson(const v1::EvaluateModelResponse& scores) {
  return {{"entities", scores.entities_size()},
          {"miou", scores.scene().reference().iou()},
          {"mbiou", scores.scene().reference().boundary_iou()},
          {"oracle_miou", scores.scene().paper().iou()},
          {"oracle_mbiou", scores.scene().paper().boundary_iou()}};
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

void AddCurves(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<BenchFlags>();
  CLI::App* verb = app.add_subcommand(
      "curves",
      "Measure error against time: train a dataset with several lengths and seeds, and score "
      "each model on the held-out views");
  verb->add_option(
          "FOLDER", flags->folder,
          "The dataset, as for upload, with label images or outlines by which segments are scored: "
          "gt/LEVEL/STEM.png with gt/labels.json, labels/STEM.png, or annotations of LabelMe or "
          "COCO")
      ->required();
  verb->add_option("--out", flags->out, "Folder for record.json")->default_val("build/bench");
  verb->add_option("--scene", flags->scene, "Id of the scene; by default a new one");
  verb->add_option("--presets", flags->presets, "Presets to train, separated by commas; or none")
      ->delimiter(',')
      ->check(CLI::IsMember({"preview", "standard", "best", "paper", "none"}))
      ->capture_default_str();
  verb->add_option("--steps", flags->steps,
                   "Numbers of steps of both stages to train, separated by commas, with the other "
                   "options of standard; 0: none")
      ->delimiter(',')
      ->capture_default_str();
  verb->add_option("--seeds", flags->num_seeds,
                   "Number of trainings of each kind, with seeds from 1")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  verb->add_option("--image-scale", flags->image_scale,
                   "Factor by which the photographs are shrunk, (0, 1]");
  AddDepthKindFlag(*verb, flags->depth_kind);
  verb->add_flag("--photographs-alone", flags->photographs_alone,
                 "Upload nothing but the photographs, so that the server makes poses and masks");
  verb->add_option("-o,--option", flags->settings, "Any option, for every training")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  verb->add_option("--fact", flags->facts,
                   "A fact for the record, such as machine=... or commit=...")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  verb->callback([flags, &shell] {
    std::erase(flags->steps, 0);
    std::erase(flags->presets, "none");
    shell.verb = [&, flags] { return RunBench(shell, *flags); };
  });
}

Json ToJson(const BenchRecord& record) {
  Json json = {{"record", "pepeseg-benchmark curves"}, {"dataset", record.dataset}};
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
