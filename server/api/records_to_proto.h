#pragma once

#include "absl/status/statusor.h"
#include "pepeseg/v1/dataset_service.pb.h"
#include "pepeseg/v1/job_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"
#include "pepeseg/v1/selection_service.pb.h"
#include "server/store/records.h"

// Converts records of the store to resources of the contract.
namespace pepeseg {

v1::Model ToProto(const ModelRecord& record);
v1::Dataset ToProto(const DatasetRecord& record);
// Sets everything but the progress, which is not in the store.
v1::Job ToProto(const JobRecord& record);
v1::Selection ToProto(const SelectionRecord& record);
v1::JobState ToProto(JobState state);

// Returns INVALID_ARGUMENT for a negative page_size; a page_size over 1000 becomes 1000.
absl::StatusOr<PageRequest> PageFromProto(int32_t page_size, const std::string& page_token);

// Returns INVALID_ARGUMENT for an id of more than 128 bytes.
absl::Status CheckRequestId(const std::string& request_id);

}  // namespace pepeseg
