#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "clients/cpp/dataset_folder.h"
#include "clients/cpp/upload_progress.h"
#include "pepeseg/v1/dataset_service.grpc.pb.h"

namespace pepeseg::client {

// Sends what the upload misses, each file from where the server has it, and seals. After a lost
// connection, or where an earlier stream of the file is not given up yet, it asks what is there and
// goes on, until nothing has come through for a minute. Errors: the server's, naming the file.
absl::StatusOr<v1::Dataset> FinishUpload(v1::DatasetService::Stub& datasets, v1::Upload upload,
                                         const DatasetFolder& folder,
                                         const UploadProgress& progress);

}  // namespace pepeseg::client
