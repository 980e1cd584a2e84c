#pragma once

#include <cstdint>
#include <filesystem>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "server/services/model_loader.h"
#include "server/store/records.h"

namespace pepeseg {

// Writes the files of a model that is made from another one: from its folder to the new one.
// Returns their size, bytes.
using WriteVersion = absl::FunctionRef<absl::StatusOr<int64_t>(const std::filesystem::path& from,
                                                               const std::filesystem::path& to)>;

// Stores a model that was made from the model `from`, as the live one of its scene. `made`: what
// its record differs in from that of `from`; number, folder, num_bytes, made_from and create_time
// are set here. Returns the record. Errors are those of `write` and ModelStore::CreateVersion.
absl::StatusOr<ModelRecord> StoreVersion(ModelLoader& models, const ModelRecord& from,
                                         ModelRecord made, WriteVersion write);

}  // namespace pepeseg
