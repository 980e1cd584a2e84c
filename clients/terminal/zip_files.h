#pragma once

#include <string>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace pepeseg::client::cli {

// Calls `use` for each file of a zip, in the order of its directory, until that returns an error,
// which is returned. DATA_LOSS: the zip is malformed, a file fails its checksum, or a name leads
// out of the folder that the zip is unpacked to. Reads stored and deflated files of at most 2 GiB.
absl::Status ForEachZipFile(
    absl::string_view zip,
    absl::FunctionRef<absl::Status(const std::string& name, absl::string_view bytes)> use);

}  // namespace pepeseg::client::cli
