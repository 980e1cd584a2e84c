#include "server/worker_protocol/job_spec.h"

#include <google/protobuf/util/json_util.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/worker_protocol/client_text.h"

namespace pepeseg {

// The fields of the files, in both directions; a field that is missing or of another type throws.
// Apart are JobSpec::options, a message, and JobResult::status.
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(WorkerOptions, sandbox, sandbox_reads, pass_environment, colmap,
                                   priors_command, priors_seconds, sam, keep_embeddings,
                                   lpips_weights, log_format)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(JobSpecFile, name, kind, path, sha256)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(JobSpec, job, fence, files, device, num_threads,
                                   checkpoint_seconds, checkpoint_steps, memory_limit, traceparent,
                                   lease_seconds, worker)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(JobResult, metrics, num_gaussians, num_bytes, sources, damaged)

namespace {

using Json = nlohmann::json;

// Limits of a worker's result: entries of a map, bytes of a name, bytes of a source.
constexpr size_t kMaxResultEntries = 1000, kMaxNameBytes = 100, kMaxSourceBytes = 256;

std::string Dump(const Json& json) {
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

absl::StatusOr<Json> ParseJson(const std::filesystem::path& path, const std::string& text) {
  Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return absl::DataLossError(path.string() + ": is not a JSON object");
  return json;
}

// Decodes a spec or a result with `decode`, in which nlohmann throws where a field is missing or
// has another type. DATA_LOSS: it threw.
template <typename T>
absl::StatusOr<T> Decode(const std::filesystem::path& path, const Json& json,
                         T (*decode)(const Json&)) {
  try {
    return decode(json);
  } catch (const Json::exception& error) {
    return absl::DataLossError(absl::StrCat(path.string(), ": ", error.what()));
  }
}

JobResult DecodeResult(const Json& json) {
  JobResult result = json.get<JobResult>();
  result.status = absl::Status(static_cast<absl::StatusCode>(json.at("code").get<int>()),
                               ClientText(json.at("message").get<std::string>()));
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

}  // namespace

std::string MetricsToJson(const std::map<std::string, double>& metrics) {
  return FiniteMetrics(metrics).dump();
}

std::string SourcesToJson(const std::map<std::string, std::string>& sources) {
  return Json(sources).dump(-1, ' ', false, Json::error_handler_t::replace);
}

absl::StatusOr<std::string> FormatJobSpec(const JobSpec& spec) {
  std::string options;
  if (!google::protobuf::util::MessageToJsonString(spec.options, &options).ok()) {
    return absl::InternalError("the training options have no JSON form");
  }
  Json json = spec;
  json["options"] = Json::parse(options, nullptr, false);
  return Dump(json);
}

absl::StatusOr<JobSpec> ParseJobSpec(const std::filesystem::path& file, const std::string& text) {
  ASSIGN_OR_RETURN(const Json json, ParseJson(file, text));
  ASSIGN_OR_RETURN(JobSpec spec,
                   Decode<JobSpec>(file, json, [](const Json& of) { return of.get<JobSpec>(); }));
  const std::string options = json.value("options", Json::object()).dump();
  if (!google::protobuf::util::JsonStringToMessage(options, &spec.options).ok()) {
    return absl::DataLossError(file.string() + ": options are not training options");
  }
  return spec;
}

std::string FormatJobResult(const JobResult& result) {
  Json json = result;
  json["metrics"] = FiniteMetrics(result.metrics);
  json["code"] = static_cast<int>(result.status.code());
  json["message"] = std::string(result.status.message());
  return Dump(json);
}

absl::StatusOr<JobResult> ParseJobResult(const std::filesystem::path& file,
                                         const std::string& text) {
  ASSIGN_OR_RETURN(const Json json, ParseJson(file, text));
  ASSIGN_OR_RETURN(JobResult result, Decode(file, json, &DecodeResult));
  if (result.num_gaussians < 0 || result.num_bytes < 0) {
    return absl::DataLossError(file.string() + ": a negative number");
  }
  CleanEntries(result.metrics, [](double value) { return value; });
  CleanEntries(result.sources,
               [](const std::string& value) { return ClientText(value, kMaxSourceBytes); });
  return result;
}

}  // namespace pepeseg
