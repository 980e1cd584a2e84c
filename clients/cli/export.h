#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "clients/cli/connection.h"
#include "pepeseg/v1/render.pb.h"

namespace pepeseg::cli {

// Fetches the PLY that a request asks for, checks it and puts it where it belongs only when it is
// whole.
absl::StatusOr<v1::ExportSelectionResponse::Header> FetchPly(
    const Connection& connection, const v1::ExportSelectionRequest& request,
    const std::string& file);

}  // namespace pepeseg::cli
