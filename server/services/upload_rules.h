#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/dataset_service.pb.h"
#include "server/store/rows.h"

namespace pepeseg {

// What a client may call a file: relative, '/' between non-empty parts that are neither "." nor
// "..", UTF-8 without control characters or '\', at most 512 bytes. INVALID_ARGUMENT names `field`.
absl::Status CheckUploadPath(const std::string& path, const std::string& field);

// The files of a CreateUpload, checked against the limits that dataset_service.proto states; none
// is `stored` yet.
absl::StatusOr<std::vector<DatasetFileRow>> CheckUploadFiles(
    const v1::CreateUploadRequest& request);

}  // namespace pepeseg
