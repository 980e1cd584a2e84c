#include "server/worker_protocol/job_folder.h"

#include <fcntl.h>
#include <google/protobuf/util/json_util.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/atomic_file.h"
#include "core/base/beneath_folder.h"
#include "core/base/file_bytes.h"
#include "core/base/file_error.h"
#include "core/base/status_macros.h"
#include "core/model_files/manifest.h"
#include "server/worker_protocol/client_text.h"
#include "server/worker_protocol/event_log.h"

namespace pepeseg {
namespace {

using Json = nlohmann::json;

// A spec lists at most 20,000 files.
constexpr int64_t kMaxSpecBytes = 64 << 20;
// A worker's result is a page.
constexpr int64_t kMaxResultBytes = 1 << 20;
constexpr size_t kMaxResultEntries = 1000, kMaxNameBytes = 100, kMaxSourceBytes = 256;

std::string Dump(const Json& json) {
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

absl::StatusOr<Json> ParseJson(const std::filesystem::path& path, const std::string& text) {
  Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return absl::DataLossError(path.string() + ": is not a JSON object");
  return json;
}

// Decodes a spec or a result. DATA_LOSS: a field is missing or of another type, upon which nlohmann
// throws.
template <typename T>
absl::StatusOr<T> Decode(const std::filesystem::path& path, const Json& json,
                         T (*decode)(const Json&)) {
  try {
    return decode(json);
  } catch (const Json::exception& error) {
    return absl::DataLossError(absl::StrCat(path.string(), ": ", error.what()));
  }
}

Json Encode(const WorkerOptions& options) {
  return {{"sandbox", options.sandbox},
          {"sandbox_reads", options.sandbox_reads},
          {"pass_environment", options.pass_environment},
          {"colmap", options.colmap},
          {"priors_command", options.priors_command},
          {"priors_seconds", options.priors_seconds},
          {"sam", options.sam.string()},
          {"lpips_weights", options.lpips_weights.string()},
          {"log_format", options.log_format}};
}

WorkerOptions DecodeWorkerOptions(const Json& json) {
  WorkerOptions options;
  options.sandbox = json.at("sandbox").get<bool>();
  options.sandbox_reads = json.at("sandbox_reads").get<std::vector<std::string>>();
  options.pass_environment = json.at("pass_environment").get<std::vector<std::string>>();
  options.colmap = json.at("colmap").get<std::string>();
  options.priors_command = json.at("priors_command").get<std::string>();
  options.priors_seconds = json.at("priors_seconds").get<int64_t>();
  options.sam = json.at("sam").get<std::string>();
  options.lpips_weights = json.at("lpips_weights").get<std::string>();
  options.log_format = json.at("log_format").get<std::string>();
  return options;
}

JobSpec DecodeSpec(const Json& json) {
  JobSpec spec;
  spec.job = json.at("job").get<std::string>();
  spec.fence = json.at("fence").get<int64_t>();
  spec.device = json.at("device").get<std::string>();
  spec.num_threads = json.at("num_threads").get<int>();
  spec.checkpoint_seconds = json.at("checkpoint_seconds").get<int64_t>();
  spec.checkpoint_steps = json.at("checkpoint_steps").get<int64_t>();
  spec.memory_limit = json.at("memory_limit").get<int64_t>();
  spec.traceparent = json.value("traceparent", "");
  spec.lease_seconds = json.at("lease_seconds").get<int64_t>();
  spec.worker = DecodeWorkerOptions(json.at("worker"));
  for (const Json& file : json.at("files")) {
    spec.files.push_back({file.at("name").get<std::string>(), file.at("kind").get<int>(),
                          file.at("path").get<std::string>(),
                          file.at("sha256").get<std::string>()});
  }
  return spec;
}

JobResult DecodeResult(const Json& json) {
  JobResult result;
  result.status = absl::Status(static_cast<absl::StatusCode>(json.at("code").get<int>()),
                               ClientText(json.at("message").get<std::string>()));
  result.metrics = json.at("metrics").get<std::map<std::string, double>>();
  result.num_gaussians = json.at("num_gaussians").get<int64_t>();
  result.num_bytes = json.at("num_bytes").get<int64_t>();
  result.sources = json.at("sources").get<std::map<std::string, std::string>>();
  result.damaged = json.value("damaged", std::vector<std::string>());
  return result;
}

// Cleans the entries of a worker's result for clients: at most kMaxResultEntries, names as
// ClientTexts.
template <typename Value, typename Clean>
void CleanEntries(std::map<std::string, Value>& entries, Clean clean) {
  std::map<std::string, Value> cleaned;
  for (const auto& [name, value] : entries) {
    if (cleaned.size() < kMaxResultEntries) cleaned[ClientText(name, kMaxNameBytes)] = clean(value);
  }
  entries = std::move(cleaned);
}

Json FiniteMetrics(const std::map<std::string, double>& metrics) {
  Json json = Json::object();
  for (const auto& [name, value] : metrics) {
    if (std::isfinite(value)) json[name] = value;
  }
  return json;
}

std::filesystem::path SpecPath(const std::filesystem::path& folder, int64_t fence) {
  return folder / absl::StrCat("spec-", fence, ".json");
}

std::string ResultName(int64_t fence) { return absl::StrCat("result-", fence, ".json"); }

std::string AttemptName(int64_t fence) { return absl::StrCat("attempt-", fence); }

// Removes the entries of a folder, except logs, JSON files and those named in `keep`.
void RemoveAllBut(const BeneathFolder& folder, const std::vector<std::string>& keep) {
  const auto entries = folder.List();
  if (!entries.ok()) return;
  for (const BeneathFolder::Entry& entry : *entries) {
    const std::string suffix = std::filesystem::path(entry.name).extension();
    const bool told = entry.is_file && (suffix == ".log" || suffix == ".json");
    // An entry that cannot be removed only costs space.
    const bool kept = told || std::find(keep.begin(), keep.end(), entry.name) != keep.end();
    if (!kept) folder.RemoveAll(entry.name).IgnoreError();
  }
}

}  // namespace

std::string MetricsToJson(const std::map<std::string, double>& metrics) {
  return FiniteMetrics(metrics).dump();
}

std::string SourcesToJson(const std::map<std::string, std::string>& sources) {
  return Json(sources).dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::filesystem::path JobFolder::work() const { return path_ / kWorkFolder; }

std::filesystem::path JobFolder::attempt(int64_t fence) const {
  return work() / AttemptName(fence);
}

std::filesystem::path JobFolder::model(int64_t fence) const { return path_ / AttemptName(fence); }

std::filesystem::path JobFolder::frames(int64_t fence) const { return attempt(fence) / "frames"; }

std::filesystem::path JobFolder::poses(int64_t fence) const { return attempt(fence) / "poses"; }

std::filesystem::path JobFolder::reconstruction(int64_t fence) const {
  return attempt(fence) / "reconstruct";
}

std::filesystem::path JobFolder::checkpoints(int64_t fence) const {
  return attempt(fence) / "checkpoints";
}

std::filesystem::path JobFolder::heartbeat(int64_t fence) const {
  return work() / absl::StrCat("pulse-", fence);
}

std::filesystem::path JobFolder::lease(int64_t fence) const {
  return path_ / absl::StrCat("lease-", fence);
}

absl::Status JobFolder::Make() const {
  std::error_code error;
  std::filesystem::create_directories(work(), error);
  return error ? FileError(work(), "create", error.value()) : absl::OkStatus();
}

bool JobFolder::HasSaved(int64_t fence) const {
  const absl::StatusOr<BeneathFolder> work = BeneathFolder::Open(this->work());
  if (!work.ok()) return false;
  for (const char* stage : {"frames", "poses", "reconstruct"}) {
    if (work->HasFile(AttemptName(fence) / std::filesystem::path(stage) / kManifestName)) {
      return true;
    }
  }
  const auto folder = work->OpenFolder(AttemptName(fence) / std::filesystem::path("checkpoints"));
  if (!folder.ok()) return false;
  const auto entries = folder->List();
  return entries.ok() &&
         std::any_of(entries->begin(), entries->end(), [](const BeneathFolder::Entry& entry) {
           return entry.is_file && entry.name.ends_with(".ckpt");
         });
}

void JobFolder::RemoveWorkingFiles(const std::string& keep) const {
  const absl::StatusOr<BeneathFolder> folder = BeneathFolder::Open(path_);
  if (!folder.ok()) return;
  const absl::StatusOr<BeneathFolder> work = folder->OpenFolder(kWorkFolder);
  if (work.ok()) RemoveAllBut(*work, {});
  RemoveAllBut(*folder, {keep, kWorkFolder});
}

absl::StatusOr<int64_t> JobFolder::TakeModel(int64_t fence) const {
  const std::string name = AttemptName(fence);
  ASSIGN_OR_RETURN(const BeneathFolder folder, BeneathFolder::Open(path_));
  if (const absl::Status there = folder.OpenFolder(name).status(); !there.ok()) {
    if (!absl::IsNotFound(there)) return there;
    ASSIGN_OR_RETURN(const BeneathFolder work, folder.OpenFolder(kWorkFolder));
    if (renameat2(work.descriptor(), name.c_str(), folder.descriptor(), name.c_str(),
                  RENAME_NOREPLACE) != 0) {
      return FileError(model(fence), "take the result", errno);
    }
    RETURN_IF_ERROR(SyncFolder(this->work()));
    RETURN_IF_ERROR(SyncFolder(path_));
  }
  // Checked only after the move: a worker could still change what is in its own folder.
  const absl::StatusOr<BeneathFolder> taken = folder.OpenFolder(name);
  absl::StatusOr<int64_t> num_bytes = taken.ok() ? taken->CheckPlain() : taken.status();
  if (absl::IsFailedPrecondition(num_bytes.status())) {
    folder.RemoveAll(name).IgnoreError();
    return absl::FailedPreconditionError(
        absl::StrCat("the worker's result is not taken: ", num_bytes.status().message()));
  }
  return num_bytes;
}

int64_t JobFolder::NewestFence() const {
  int64_t newest = 0;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(path_, error), end; !error && entry != end;
       entry.increment(error)) {
    std::string name = entry->path().filename().string();
    int64_t fence = 0;
    if (!name.starts_with("spec-") || entry->path().extension() != ".json") continue;
    name = entry->path().stem().string().substr(5);
    if (absl::SimpleAtoi(name, &fence)) newest = std::max(newest, fence);
  }
  return newest;
}

absl::Status JobFolder::WriteSpec(const JobSpec& spec) const {
  std::string options;
  if (!google::protobuf::util::MessageToJsonString(spec.options, &options).ok()) {
    return absl::InternalError("the training options have no JSON form");
  }
  Json json = {{"job", spec.job},
               {"fence", spec.fence},
               {"device", spec.device},
               {"num_threads", spec.num_threads},
               {"checkpoint_seconds", spec.checkpoint_seconds},
               {"checkpoint_steps", spec.checkpoint_steps},
               {"memory_limit", spec.memory_limit},
               {"traceparent", spec.traceparent},
               {"lease_seconds", spec.lease_seconds},
               {"worker", Encode(spec.worker)},
               {"options", Json::parse(options, nullptr, false)},
               {"files", Json::array()}};
  for (const JobSpecFile& file : spec.files) {
    json["files"].push_back(
        {{"name", file.name}, {"kind", file.kind}, {"path", file.path}, {"sha256", file.sha256}});
  }
  return WriteFileAtomically(SpecPath(path_, spec.fence), Dump(json));
}

absl::StatusOr<JobSpec> JobFolder::ReadSpec(int64_t fence) const {
  const std::filesystem::path path = SpecPath(path_, fence);
  ASSIGN_OR_RETURN(const std::string text, ReadFile(path, path.string(), kMaxSpecBytes));
  ASSIGN_OR_RETURN(const Json json, ParseJson(path, text));
  ASSIGN_OR_RETURN(JobSpec spec, Decode(path, json, &DecodeSpec));
  const std::string options = json.value("options", Json::object()).dump();
  if (!google::protobuf::util::JsonStringToMessage(options, &spec.options).ok()) {
    return absl::DataLossError(path.string() + ": options are not training options");
  }
  return spec;
}

absl::Status JobFolder::WriteResult(int64_t fence, const JobResult& result) const {
  const Json json = {{"code", static_cast<int>(result.status.code())},
                     {"message", std::string(result.status.message())},
                     {"metrics", FiniteMetrics(result.metrics)},
                     {"num_gaussians", result.num_gaussians},
                     {"num_bytes", result.num_bytes},
                     {"sources", result.sources},
                     {"damaged", result.damaged}};
  return WriteFileAtomically(work() / ResultName(fence), Dump(json));
}

absl::StatusOr<JobResult> JobFolder::ReadResult(int64_t fence) const {
  ASSIGN_OR_RETURN(const BeneathFolder work, BeneathFolder::Open(this->work()));
  const std::string name = ResultName(fence);
  const absl::StatusOr<std::string> text = work.ReadFile(name, kMaxResultBytes);
  if (absl::IsFailedPrecondition(text.status())) {
    return absl::DataLossError(text.status().message());
  }
  RETURN_IF_ERROR(text.status());
  ASSIGN_OR_RETURN(const Json json, ParseJson(name, *text));
  ASSIGN_OR_RETURN(JobResult result, Decode(name, json, &DecodeResult));
  if (result.num_gaussians < 0 || result.num_bytes < 0) {
    return absl::DataLossError(name + ": a negative number");
  }
  CleanEntries(result.metrics, [](double value) { return value; });
  CleanEntries(result.sources,
               [](const std::string& value) { return ClientText(value, kMaxSourceBytes); });
  return result;
}

absl::Status CheckModelFolder(const std::filesystem::path& data,
                              const std::filesystem::path& model) {
  ASSIGN_OR_RETURN(const BeneathFolder folder, BeneathFolder::Open(data));
  const absl::StatusOr<BeneathFolder> files = folder.OpenFolder(model);
  const absl::Status status =
      files.ok() ? files->CheckPlain(/*other_names=*/true).status() : files.status();
  // Other errors are left to whoever reads the model next.
  return absl::IsFailedPrecondition(status) ? absl::DataLossError(status.message())
                                            : absl::OkStatus();
}

}  // namespace pepeseg
