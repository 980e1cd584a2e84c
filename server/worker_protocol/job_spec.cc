#include "server/worker_protocol/job_spec.h"

#include <google/protobuf/util/json_util.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/worker_protocol/client_text.h"

namespace pepeseg {
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

Json Encode(const WorkerOptions& options) {
  return {{"sandbox", options.sandbox},
          {"sandbox_reads", options.sandbox_reads},
          {"pass_environment", options.pass_environment},
          {"colmap", options.colmap},
          {"priors_command", options.priors_command},
          {"priors_seconds", options.priors_seconds},
          {"sam", options.sam.string()},
          {"keep_embeddings", options.keep_embeddings},
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
  options.keep_embeddings = json.at("keep_embeddings").get<bool>();
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
  spec.traceparent = json.at("traceparent").get<std::string>();
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
  result.damaged = json.at("damaged").get<std::vector<std::string>>();
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
  return Dump(json);
}

absl::StatusOr<JobSpec> ParseJobSpec(const std::filesystem::path& file, const std::string& text) {
  ASSIGN_OR_RETURN(const Json json, ParseJson(file, text));
  ASSIGN_OR_RETURN(JobSpec spec, Decode(file, json, &DecodeSpec));
  const std::string options = json.value("options", Json::object()).dump();
  if (!google::protobuf::util::JsonStringToMessage(options, &spec.options).ok()) {
    return absl::DataLossError(file.string() + ": options are not training options");
  }
  return spec;
}

std::string FormatJobResult(const JobResult& result) {
  const Json json = {{"code", static_cast<int>(result.status.code())},
                     {"message", std::string(result.status.message())},
                     {"metrics", FiniteMetrics(result.metrics)},
                     {"num_gaussians", result.num_gaussians},
                     {"num_bytes", result.num_bytes},
                     {"sources", result.sources},
                     {"damaged", result.damaged}};
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
