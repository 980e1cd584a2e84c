// The verb "suite": the field's benchmarks, from their folders to their tables.
#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "clients/benchmark/evaluation_table.h"
#include "clients/benchmark/suite_record.h"
#include "clients/benchmark/suite_request.h"
#include "clients/benchmark/suite_run.h"
#include "clients/benchmark/suite_scene.h"
#include "clients/benchmark/suite_table.h"
#include "clients/benchmark/suite_text.h"
#include "clients/benchmark/suite_variants.h"
#include "clients/benchmark/verbs.h"
#include "clients/cpp/client.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/flags.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/training_run.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

struct BenchmarkFlags {
  std::string benchmark;
  std::string folder;
  std::string preset = "standard";
  std::string protocol;  // "": the benchmark's own
  int num_seeds = 1;     // each scene is trained with seeds 1 to this
  SceneSearch search;
  std::string out;
  bool ablation = false, robustness = false, refine_borders = true, keep_models = false;
  std::vector<std::string> settings;  // NAME=VALUE, of every training
};

std::vector<BenchmarkVariant> VariantsOf(const BenchmarkFlags& flags) {
  std::vector<BenchmarkVariant> variants;
  if (flags.ablation) variants = AblationVariants();
  if (flags.robustness) {
    for (BenchmarkVariant& variant : RobustnessVariants()) variants.push_back(std::move(variant));
  }
  if (variants.empty()) variants.emplace_back();
  return variants;
}

// Returns the id of a scene on the server: "nvos-horns_left".
std::string SceneId(const std::string& benchmark, const std::string& scene) {
  constexpr size_t kMaxLength = 63;
  std::string id = absl::StrCat(benchmark, "-", scene);
  for (char& c : id) {
    if (!absl::ascii_isalnum(static_cast<unsigned char>(c)) && c != '_' && c != '.') c = '-';
  }
  return id.substr(0, kMaxLength);
}

// All runs of a benchmark.
class BenchmarkSession {
 public:
  BenchmarkSession(const Shell& shell, const BenchmarkFlags& flags, RunRecord record)
      : shell_(shell), flags_(flags), client_(shell.channel), record_(std::move(record)) {
    plan_.benchmark = BenchmarkOf(flags.benchmark);
    plan_.by_text = flags.protocol == kTextProtocol;
    plan_.protocol = flags.protocol.empty() || plan_.by_text ? ProtocolOf(plan_.benchmark)
                                                             : ProtocolsByName().at(flags.protocol);
    plan_.settings = {"preset=" + flags.preset};
    plan_.settings.insert(plan_.settings.end(), flags.settings.begin(), flags.settings.end());
    plan_.refine_borders = flags.refine_borders;
    plan_.keep_models = flags.keep_models;
    plan_.pictures = fs::path(flags.out) / "pictures";
  }

  // Runs what the record lacks of a scene.
  absl::Status Run(const BenchmarkScene& scene, const BenchmarkVariant& variant) {
    for (int seed = 1; seed <= flags_.num_seeds; ++seed) {
      ScoredRun run;
      run.benchmark = flags_.benchmark;
      run.scene = scene.name;
      run.variant = variant.name;
      run.protocol = plan_.by_text ? kTextProtocol : ProtocolName(plan_.protocol);
      run.seed = seed;
      run.options = absl::StrJoin(plan_.settings, ", ");
      if (!plan_.refine_borders) run.options += ", no refine_borders";
      if (record_.Has(run)) {
        Note(absl::StrCat("in the record: ", scene.name, " ", variant.name, ", seed ", seed));
      } else {
        ASSIGN_OR_RETURN(const std::string dataset, Upload(scene, variant));
        RETURN_IF_ERROR(RunScene(client_, plan_, scene, variant, dataset, run));
        RETURN_IF_ERROR(record_.Add(run));
        if (!shell_.json) Print(LineOf(run));
      }
      runs_of_now_.push_back(run);
    }
    return absl::OkStatus();
  }

  // Writes the tables of the runs asked for, and prints them.
  absl::Status Report() const {
    std::vector<ScoredRun> runs;
    for (const ScoredRun& asked : runs_of_now_) {
      for (const ScoredRun& run : record_.runs()) {
        const bool same = run.scene == asked.scene && run.variant == asked.variant &&
                          run.seed == asked.seed && run.protocol == asked.protocol &&
                          run.options == asked.options && run.benchmark == asked.benchmark;
        if (same) runs.push_back(run);
      }
    }
    const fs::path out = flags_.out;
    RETURN_IF_ERROR(WriteFile(out / "table.md", ReportMarkdown(plan_.benchmark, runs)));
    RETURN_IF_ERROR(WriteFile(out / "table.csv", Csv(SceneTable(runs))));
    const std::vector<TableRow> published = PublishedTable(plan_.benchmark, runs);
    if (!published.empty()) RETURN_IF_ERROR(WriteFile(out / "published.csv", Csv(published)));
    const std::string json = nlohmann::json(runs).dump();
    RETURN_IF_ERROR(WriteFile(out / "table.json", json + "\n"));
    Note(absl::StrCat("table.md, .csv and .json, record.jsonl and pictures/ are in ", flags_.out));
    Note(absl::StrCat("A plot: tests/bench/plots.py entities ", Quoted(out / "record.jsonl"),
                      " --out entities.svg"));
    if (shell_.json) {
      Print(json);
      return absl::OkStatus();
    }
    for (const std::string& line : TextTable(SceneTable(runs))) Print(line);
    for (const std::string& line : TextTable(published)) Print(line);
    const std::string caveat = PublishedCaveat(plan_.benchmark, runs);
    if (!caveat.empty()) Print(caveat);
    return absl::OkStatus();
  }

 private:
  // Returns the dataset of the scene, which is uploaded once for all seeds and options.
  absl::StatusOr<std::string> Upload(const BenchmarkScene& scene, const BenchmarkVariant& variant) {
    const std::string key =
        absl::StrCat(scene.name, "/", variant.quarter_of_views, "/", variant.fewer_masks);
    if (const auto known = datasets_.find(key); known != datasets_.end()) return known->second;
    ASSIGN_OR_RETURN(const DatasetFolder folder,
                     DatasetOf(variant, scene, fs::path(flags_.out) / "thinned"));
    const std::string id = SceneName(SceneId(flags_.benchmark, scene.name));
    RETURN_IF_ERROR(client_.EnsureScene(id));
    ASSIGN_OR_RETURN(const v1::Dataset dataset, UploadFolder(client_, id, folder));
    return datasets_[key] = dataset.name();
  }

  const Shell& shell_;
  const BenchmarkFlags& flags_;
  const Client client_;
  RunRecord record_;
  BenchmarkPlan plan_;
  std::map<std::string, std::string> datasets_;  // names of those that are uploaded
  std::vector<ScoredRun> runs_of_now_;           // asked for, done now or before
};

absl::Status RunBenchmark(const Shell& shell, const BenchmarkFlags& flags) {
  if (flags.protocol == kTextProtocol && BenchmarkOf(flags.benchmark) != Benchmark::kLerfMask) {
    return absl::InvalidArgumentError(
        "--protocol text is for lerf-mask, whose entities have names");
  }
  ASSIGN_OR_RETURN(const std::vector<BenchmarkScene> scenes,
                   FindScenes(BenchmarkOf(flags.benchmark), flags.folder, flags.search));
  ASSIGN_OR_RETURN(RunRecord record, RunRecord::Open(fs::path(flags.out) / "record.jsonl"));
  // Fail before the trainings, not after them, if the tables cannot be written.
  RETURN_IF_ERROR(OutputFile::Create(fs::path(flags.out) / "table.md").status());
  BenchmarkSession session(shell, flags, std::move(record));
  for (const BenchmarkVariant& variant : VariantsOf(flags)) {
    for (const BenchmarkScene& scene : scenes) RETURN_IF_ERROR(session.Run(scene, variant));
  }
  return session.Report();
}

void AddRunFlags(CLI::App& verb, BenchmarkFlags& flags) {
  verb.add_option("--preset", flags.preset, "Preset of the trainings, as for train")
      ->capture_default_str();
  verb.add_option("--seeds", flags.num_seeds, "Number of trainings of each scene, seeds from 1")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  verb.add_option("--protocol", flags.protocol,
                  "Protocol instead of the benchmark's own: prompt, label-propagation, "
                  "label-propagation-pixels, promptable or, of lerf-mask, text")
      ->check(CLI::IsMember({"prompt", "label-propagation", "label-propagation-pixels",
                             "promptable", kTextProtocol}));
  verb.add_flag("--ablation", flags.ablation,
                "Train without parts of the method, and with other k, tau and T");
  verb.add_flag("--robustness", flags.robustness,
                "Train with a quarter of the views, and with 30 % fewer masks");
  verb.add_flag("!--no-refine-borders", flags.refine_borders,
                "Score masks that are exactly the pixels above the threshold");
  verb.add_flag("--keep-models", flags.keep_models, "Do not delete models when they are scored");
  verb.add_option("-o,--option", flags.settings, "Any option, for every training")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
}

}  // namespace

void AddSuite(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<BenchmarkFlags>();
  CLI::App* verb = app.add_subcommand(
      "suite", "Train and score the scenes of one of the field's benchmarks, as papers do");
  verb->add_option("BENCHMARK", flags->benchmark,
                   "nvos, spin-nerf, lerf-mask, lerf-mask-fine or "
                   "scene (folders of our own)")
      ->required()
      ->check(CLI::IsMember(BenchmarkNames()));
  verb->add_option("FOLDER", flags->folder,
                   "The benchmark's folder, see clients/benchmark/README.md")
      ->required();
  verb->add_option("--scenes", flags->search.scenes, "Scenes, separated by commas; default: all")
      ->delimiter(',');
  verb->add_option("--images", flags->search.images,
                   "Folder of the photographs of LLFF scenes; default: the first of images_4, "
                   "images_8, images_2 and images that exists");
  verb->add_option("--out", flags->out,
                   "Folder for the tables, the pictures of the worst entities, and record.jsonl; "
                   "runs that are in the record are not repeated")
      ->default_val("build/benchmark");
  AddRunFlags(*verb, *flags);
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunBenchmark(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
