#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "clients/cli/connection.h"
#include "clients/cli/dataset_folder.h"
#include "clients/cli/progress_line.h"
#include "pepeseg/v1/dataset_service.pb.h"

namespace pepeseg::cli {

// Sends what the upload misses, each file from where the server has it, and seals. After a lost
// connection, or where an earlier stream of the file is not given up yet, it asks what is there and
// goes on, until nothing has come through for a minute. Errors: the server's, naming the file.
absl::StatusOr<v1::Dataset> FinishUpload(const Connection& connection, v1::Upload upload,
                                         const DatasetFolder& folder);

}  // namespace pepeseg::cli
