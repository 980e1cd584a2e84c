#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "absl/status/statusor.h"
#include "core/scene/model.h"

namespace pepeseg {

// Models that are made from other ones.

// The fact of an edited model, and of those made from it: name of the model that was edited. The
// photographs do not show such a model.
inline constexpr char kEditedFrom[] = "edited_from";
inline bool IsEdited(const Model& model) { return model.facts.contains(kEditedFrom); }

// Writes a model that has other features than the model in the folder `from`, to the folder `to`,
// which must not exist; its parent is made where it is missing. Only features.bin, model.json and
// the manifest are written: the other files of `from`, listed in its manifest or not, get a second
// name (hard link), or are copied where the file system has no such links. So either folder may be
// removed. `provenance`: the value of the fact "corrected_from". Everything is durable when it
// returns. Returns the size of all files in bytes, as if none were shared.
//
// Removes `to` again after an error. Errors are those of ReadManifest and WriteFeatureFile, and
// those of FileError: RESOURCE_EXHAUSTED if the disk is full, NOT_FOUND if `from` was deleted
// meanwhile.
absl::StatusOr<int64_t> WriteCorrectedModel(const std::filesystem::path& from,
                                            const std::filesystem::path& to,
                                            const FeatureField& field,
                                            const std::string& provenance);

// Writes an edited model to the folder `to`, which must not exist; its parent is made where it is
// missing. Everything is durable when it returns. Returns the size of all files in bytes. Removes
// `to` again after an error. Errors are those of WriteModel and FileError.
absl::StatusOr<int64_t> WriteEditedModel(const std::filesystem::path& to, const Model& model);

}  // namespace pepeseg
