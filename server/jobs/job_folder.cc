#include "server/jobs/job_folder.h"

#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/io/atomic_file.h"
#include "core/io/file_bytes.h"
#include "core/io/manifest.h"
#include "core/status_macros.h"

namespace pepeseg {
namespace {

using Json = nlohmann::json;

// A spec lists at most 20,000 files.
constexpr int64_t kMaxJsonBytes = 64 << 20;

std::string Dump(const Json& json) {
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

absl::StatusOr<Json> ReadJson(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const std::string text, ReadFile(path, path.string(), kMaxJsonBytes));
  Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return absl::DataLossError(path.string() + ": is no JSON object");
  return json;
}

// The fields of a spec or a result, once both sides agree on their types: nlohmann throws
// otherwise.
template <typename T>
absl::StatusOr<T> Decode(const std::filesystem::path& path, const Json& json,
                         T (*decode)(const Json&)) {
  try {
    return decode(json);
  } catch (const Json::exception& error) {
    return absl::DataLossError(absl::StrCat(path.string(), ": ", error.what()));
  }
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
                               json.at("message").get<std::string>());
  result.metrics = json.at("metrics").get<std::map<std::string, double>>();
  result.num_gaussians = json.at("num_gaussians").get<int64_t>();
  result.num_bytes = json.at("num_bytes").get<int64_t>();
  result.sources = json.at("sources").get<std::map<std::string, std::string>>();
  return result;
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

std::filesystem::path ResultPath(const std::filesystem::path& folder, int64_t fence) {
  return folder / absl::StrCat("result-", fence, ".json");
}

}  // namespace

std::string MetricsToJson(const std::map<std::string, double>& metrics) {
  return FiniteMetrics(metrics).dump();
}

std::string SourcesToJson(const std::map<std::string, std::string>& sources) {
  return Json(sources).dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::filesystem::path JobFolder::attempt(int64_t fence) const {
  return path_ / absl::StrCat("attempt-", fence);
}

std::filesystem::path JobFolder::frames(int64_t fence) const { return attempt(fence) / "frames"; }

std::filesystem::path JobFolder::poses(int64_t fence) const { return attempt(fence) / "poses"; }

std::filesystem::path JobFolder::reconstruction(int64_t fence) const {
  return attempt(fence) / "reconstruct";
}

std::filesystem::path JobFolder::checkpoints(int64_t fence) const {
  return attempt(fence) / "checkpoints";
}

std::filesystem::path JobFolder::pulse(int64_t fence) const {
  return path_ / absl::StrCat("pulse-", fence);
}

std::filesystem::path JobFolder::lease(int64_t fence) const {
  return path_ / absl::StrCat("lease-", fence);
}

bool JobFolder::HasSaved(int64_t fence) const {
  std::error_code error;
  for (const std::filesystem::path& stage : {frames(fence), poses(fence), reconstruction(fence)}) {
    if (std::filesystem::exists(stage / kManifestName, error)) return true;
  }
  for (std::filesystem::directory_iterator entry(checkpoints(fence), error), end;
       !error && entry != end; entry.increment(error)) {
    if (entry->path().extension() == ".ckpt") return true;
  }
  return false;
}

void JobFolder::RemoveWorkingFiles(const std::string& keep) const {
  std::error_code ignored;  // what is left costs space only
  std::vector<std::filesystem::path> leftovers;
  for (std::filesystem::directory_iterator entry(path_, ignored), end; entry != end;
       entry.increment(ignored)) {
    const std::filesystem::path name = entry->path().filename();
    const bool told = name.extension() == ".log" || name.extension() == ".json";
    if (!told && name != keep) leftovers.push_back(entry->path());
  }
  for (const std::filesystem::path& path : leftovers) std::filesystem::remove_all(path, ignored);
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
  ASSIGN_OR_RETURN(const Json json, ReadJson(path));
  ASSIGN_OR_RETURN(JobSpec spec, Decode(path, json, &DecodeSpec));
  const std::string options = json.value("options", Json::object()).dump();
  if (!google::protobuf::util::JsonStringToMessage(options, &spec.options).ok()) {
    return absl::DataLossError(path.string() + ": options are no training options");
  }
  return spec;
}

absl::Status JobFolder::WriteResult(int64_t fence, const JobResult& result) const {
  const Json json = {{"code", static_cast<int>(result.status.code())},
                     {"message", std::string(result.status.message())},
                     {"metrics", FiniteMetrics(result.metrics)},
                     {"num_gaussians", result.num_gaussians},
                     {"num_bytes", result.num_bytes},
                     {"sources", result.sources}};
  return WriteFileAtomically(ResultPath(path_, fence), Dump(json));
}

absl::StatusOr<JobResult> JobFolder::ReadResult(int64_t fence) const {
  const std::filesystem::path path = ResultPath(path_, fence);
  ASSIGN_OR_RETURN(const Json json, ReadJson(path));
  return Decode(path, json, &DecodeResult);
}

}  // namespace pepeseg
