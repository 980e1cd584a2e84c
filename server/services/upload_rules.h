#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/dataset_service.pb.h"
#include "server/store/records.h"

namespace pepeseg {

// Returns INVALID_ARGUMENT, which names `field`, unless a client may give a file this path:
// relative, with '/' between parts that are neither empty nor "." nor "..", UTF-8 without control
// characters and '\', of at most 512 bytes.
absl::Status CheckUploadPath(const std::string& path, const std::string& field);

// Returns the records of the files of a CreateUpload, none of them `stored`. INVALID_ARGUMENT: they
// exceed the limits in dataset_service.proto.
absl::StatusOr<std::vector<DatasetFileRecord>> CheckUploadFiles(
    const v1::CreateUploadRequest& request);

}  // namespace pepeseg
