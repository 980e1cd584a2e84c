#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "absl/status/statusor.h"
#include "clients/cpp/client.h"
#include "clients/cpp/dataset_folder.h"
#include "pepeseg/v1/dataset_service.pb.h"

namespace pepeseg::client::cli {

// --depth-kind: "depth" or "disparity", and what that makes of the files in depth/.
void AddDepthKindFlag(CLI::App& verb, std::string& depth_kind);
v1::FileKind DepthKind(const std::string& depth_kind);

// Declares the files, sends what the server does not have of them, seals. Shows its progress. Goes
// on with an upload of the same files that was broken off. Errors: the server's, naming the file;
// DATA_LOSS when a file changed under the upload.
absl::StatusOr<v1::Dataset> UploadFolder(const Client& client, const std::string& scene,
                                         const DatasetFolder& folder);

}  // namespace pepeseg::client::cli
