#include "server/api/rows_to_proto.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/api/mask_advice.h"
#include "server/api/resource_name.h"
#include "server/worker_protocol/job_stage.h"

namespace pepeseg {
namespace {

constexpr int kMaxPageSize = 1000;
constexpr size_t kMaxRequestIdBytes = 128;

std::map<std::string, std::string> SourcesOf(const ModelRow& row) {
  std::map<std::string, std::string> sources;
  const auto json = nlohmann::json::parse(row.sources, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return sources;
  for (const auto& [what, source] : json.items()) {
    if (source.is_string()) sources[what] = source.get<std::string>();
  }
  return sources;
}

void FillSources(const std::map<std::string, std::string>& sources, v1::InputSources& proto) {
  const auto source_of = [&](const char* what) {
    const auto found = sources.find(what);
    return found == sources.end() ? std::string() : found->second;
  };
  proto.set_poses(source_of("poses"));
  proto.set_masks(source_of("masks"));
  proto.set_depth(source_of("depth"));
}

}  // namespace

v1::Model ToProto(const ModelRow& row) {
  v1::Model proto;
  proto.set_name(ChildName(row.scene, "models", row.number));
  proto.set_job(JobName(row.job));
  if (row.dataset != 0) proto.set_dataset(ChildName(row.scene, "datasets", row.dataset));
  proto.set_device(row.device);
  *proto.mutable_create_time() = ToProto(row.create_time);
  proto.set_num_gaussians(row.num_gaussians);
  proto.set_num_bytes(row.num_bytes);
  // A model whose metrics are damaged is still listed, without them.
  const auto metrics = nlohmann::json::parse(row.metrics, nullptr, /*allow_exceptions=*/false);
  if (metrics.is_object()) {
    for (const auto& [name, value] : metrics.items()) {
      if (value.is_number()) (*proto.mutable_metrics())[name] = value.get<double>();
    }
  }
  const std::map<std::string, std::string> sources = SourcesOf(row);
  FillSources(sources, *proto.mutable_sources());
  for (std::string& advice : AdviceOnModel(sources)) proto.add_advice(std::move(advice));
  if (const auto quality = proto.metrics().find("mask_quality"); quality != proto.metrics().end()) {
    for (std::string& advice : AdviceOnMaskQuality(sources, quality->second)) {
      proto.add_advice(std::move(advice));
    }
  }
  return proto;
}

v1::Dataset ToProto(const DatasetRow& row) {
  v1::Dataset proto;
  proto.set_name(ChildName(row.scene, "datasets", row.number));
  *proto.mutable_create_time() = ToProto(row.create_time);
  *proto.mutable_seal_time() = ToProto(row.seal_time);
  proto.set_num_files(row.num_files);
  proto.set_num_bytes(row.num_bytes);
  return proto;
}

v1::Job ToProto(const JobRow& row) {
  v1::Job proto;
  // A job without an id exists only in the answer to validate_only.
  if (!row.id.empty()) proto.set_name(JobName(row.id));
  proto.set_scene(SceneName(row.scene));
  proto.set_dataset(ChildName(row.scene, "datasets", row.dataset));
  proto.set_state(ToProto(row.state));
  proto.set_stage(StageOfName(row.stage));
  proto.set_device(row.device);
  // Fields of a newer version are kept as unknown fields; bytes that do not parse leave the options
  // empty.
  proto.mutable_effective_options()->ParseFromString(row.effective_options);
  if (row.state == JobState::kFailed) {
    // The text was made for clients when it was stored (ClientStatus), so nothing of it is hidden
    // here.
    *proto.mutable_error() = FlatError(
        ToProto(absl::Status(static_cast<absl::StatusCode>(row.error_code), row.error_message)));
  }
  if (row.model != 0) proto.set_model(ChildName(row.scene, "models", row.model));
  *proto.mutable_create_time() = ToProto(row.create_time);
  if (row.start_time != absl::InfinitePast()) *proto.mutable_start_time() = ToProto(row.start_time);
  if (row.end_time != absl::InfinitePast()) *proto.mutable_end_time() = ToProto(row.end_time);
  // The store keeps the request after the job's end; it says nothing then.
  proto.set_cancel_requested(row.cancel_requested && !IsTerminal(row.state));
  return proto;
}

v1::Selection ToProto(const SelectionRow& row) {
  v1::Selection proto;
  proto.set_name(ChildName(row.scene, "selections", row.number));
  proto.set_model(ChildName(row.scene, "models", row.model));
  proto.set_num_gaussians(row.num_gaussians);
  // An empty selection has no box; the record has zeros.
  if (row.num_gaussians > 0) {
    *proto.mutable_box()->mutable_min() = VectorToProto(row.min);
    *proto.mutable_box()->mutable_max() = VectorToProto(row.max);
  }
  if (row.base != 0) proto.set_base(ChildName(row.scene, "selections", row.base));
  *proto.mutable_create_time() = ToProto(row.create_time);
  return proto;
}

v1::JobState ToProto(JobState state) {
  switch (state) {
    case JobState::kQueued:
      return v1::JOB_STATE_QUEUED;
    case JobState::kRunning:
      return v1::JOB_STATE_RUNNING;
    case JobState::kSucceeded:
      return v1::JOB_STATE_SUCCEEDED;
    case JobState::kFailed:
      return v1::JOB_STATE_FAILED;
    case JobState::kCancelled:
      return v1::JOB_STATE_CANCELLED;
  }
  return v1::JOB_STATE_UNSPECIFIED;
}

absl::StatusOr<PageRequest> PageFromProto(int32_t page_size, const std::string& page_token) {
  if (page_size < 0) return BadField("page_size", absl::StrCat(page_size), "is negative");
  return PageRequest{std::min(page_size, kMaxPageSize), page_token};
}

absl::Status CheckRequestId(const std::string& request_id) {
  if (request_id.size() <= kMaxRequestIdBytes) return absl::OkStatus();
  return BadField("request_id", absl::StrCat(request_id.size()),
                  absl::StrCat("bytes; allowed are ", kMaxRequestIdBytes));
}

}  // namespace pepeseg
