#include "server/api/records_to_proto.h"

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

std::map<std::string, std::string> SourcesOf(const ModelRecord& record) {
  std::map<std::string, std::string> sources;
  const auto json = nlohmann::json::parse(record.sources, nullptr, /*allow_exceptions=*/false);
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

v1::Model ToProto(const ModelRecord& record) {
  v1::Model proto;
  proto.set_name(ChildName(record.scene, "models", record.number));
  proto.set_job(JobName(record.job));
  if (record.dataset != 0) proto.set_dataset(ChildName(record.scene, "datasets", record.dataset));
  if (record.made_from != 0) {
    std::string& from =
        *(record.edit.empty() ? proto.mutable_corrected_from() : proto.mutable_edited_from());
    from = ChildName(record.scene, "models", record.made_from);
  }
  proto.set_edit(record.edit);
  proto.set_device(record.device);
  *proto.mutable_create_time() = ToProto(record.create_time);
  proto.set_num_gaussians(record.num_gaussians);
  proto.set_num_bytes(record.num_bytes);
  // A model whose metrics are damaged is still listed, without them.
  const auto metrics = nlohmann::json::parse(record.metrics, nullptr, /*allow_exceptions=*/false);
  if (metrics.is_object()) {
    for (const auto& [name, value] : metrics.items()) {
      if (value.is_number()) (*proto.mutable_metrics())[name] = value.get<double>();
    }
  }
  const std::map<std::string, std::string> sources = SourcesOf(record);
  FillSources(sources, *proto.mutable_sources());
  for (std::string& advice : AdviceOnModel(sources)) proto.add_advice(std::move(advice));
  if (const auto quality = proto.metrics().find("mask_quality"); quality != proto.metrics().end()) {
    for (std::string& advice : AdviceOnMaskQuality(sources, quality->second)) {
      proto.add_advice(std::move(advice));
    }
  }
  return proto;
}

v1::Dataset ToProto(const DatasetRecord& record) {
  v1::Dataset proto;
  proto.set_name(ChildName(record.scene, "datasets", record.number));
  *proto.mutable_create_time() = ToProto(record.create_time);
  *proto.mutable_seal_time() = ToProto(record.seal_time);
  proto.set_num_files(record.num_files);
  proto.set_num_bytes(record.num_bytes);
  return proto;
}

v1::Job ToProto(const JobRecord& record) {
  v1::Job proto;
  // A job without an id exists only in the answer to validate_only.
  if (!record.id.empty()) proto.set_name(JobName(record.id));
  proto.set_scene(SceneName(record.scene));
  proto.set_dataset(ChildName(record.scene, "datasets", record.dataset));
  proto.set_state(ToProto(record.state));
  proto.set_stage(StageOfName(record.stage));
  proto.set_device(record.device);
  // Fields of a newer version are kept as unknown fields; bytes that do not parse leave the options
  // empty.
  proto.mutable_effective_options()->ParseFromString(record.effective_options);
  if (record.state == JobState::kFailed) {
    // The text was made for clients when it was stored (ClientStatus), so nothing of it is hidden
    // here.
    *proto.mutable_error() = FlatError(ToProto(
        absl::Status(static_cast<absl::StatusCode>(record.error_code), record.error_message)));
  }
  if (record.model != 0) proto.set_model(ChildName(record.scene, "models", record.model));
  *proto.mutable_create_time() = ToProto(record.create_time);
  if (record.start_time != absl::InfinitePast())
    *proto.mutable_start_time() = ToProto(record.start_time);
  if (record.end_time != absl::InfinitePast()) *proto.mutable_end_time() = ToProto(record.end_time);
  // The store keeps the request after the job's end; it says nothing then.
  proto.set_cancel_requested(record.cancel_requested && !IsTerminal(record.state));
  return proto;
}

v1::Selection ToProto(const SelectionRecord& record) {
  v1::Selection proto;
  proto.set_name(ChildName(record.scene, "selections", record.number));
  proto.set_model(ChildName(record.scene, "models", record.model));
  proto.set_num_gaussians(record.num_gaussians);
  // An empty selection has no box; the record has zeros.
  if (record.num_gaussians > 0) {
    *proto.mutable_box()->mutable_min() = VectorToProto(record.min);
    *proto.mutable_box()->mutable_max() = VectorToProto(record.max);
  }
  if (record.base != 0) proto.set_base(ChildName(record.scene, "selections", record.base));
  proto.set_display_name(record.display_name);
  *proto.mutable_create_time() = ToProto(record.create_time);
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
