#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "absl/status/statusor.h"
#include "clients/cpp/client.h"
#include "clients/cpp/dataset_folder.h"
#include "pepeseg/v1/dataset_service.pb.h"

namespace pepeseg::client::cli {

// Adds --depth-kind, "depth" or "disparity": the kind of the files in depth/.
void AddDepthKindFlag(CLI::App& verb, std::string& depth_kind);
// Converts a value of --depth-kind.
v1::FileKind DepthKind(const std::string& depth_kind);

// Uploads the folder as Client::Upload does, with progress on standard error.
absl::StatusOr<v1::Dataset> UploadFolder(const Client& client, const std::string& scene,
                                         const DatasetFolder& folder);

}  // namespace pepeseg::client::cli
