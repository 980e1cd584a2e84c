#pragma once

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "google/protobuf/duration.pb.h"
#include "google/protobuf/timestamp.pb.h"
#include "pepeseg/v1/dataset_service.pb.h"
#include "pepeseg/v1/job_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"
#include "server/store/rows.h"

// The store's rows as the contract's resources.
namespace pepeseg {

google::protobuf::Timestamp ToProto(absl::Time time);
google::protobuf::Duration ToProto(absl::Duration duration);

v1::Model ToProto(const ModelRow& row);
v1::Dataset ToProto(const DatasetRow& row);
// Without the progress, which is no row's.
v1::Job ToProto(const JobRow& row);
v1::JobState ToProto(JobState state);

// INVALID_ARGUMENT: a negative page_size.
absl::StatusOr<PageRequest> PageFromProto(int32_t page_size, const std::string& page_token);

// INVALID_ARGUMENT: over 128 bytes.
absl::Status CheckRequestId(const std::string& request_id);

}  // namespace pepeseg
