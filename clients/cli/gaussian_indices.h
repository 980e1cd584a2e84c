#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

// Gaussians that are given by their indices, one a line.
namespace pepeseg::client::cli {

// Returns the text of a file, or of standard input for "-". LocalFileError: it cannot be read.
absl::StatusOr<std::string> ReadIndices(const std::string& file);

// Returns the bits of v1::GaussianBits of a model: 1 for each index of the text. Empty lines are
// skipped. INVALID_ARGUMENT, naming `file` and the line: it is not a number, or the model has no
// Gaussian of this index.
absl::StatusOr<std::string> BitsOfIndices(absl::string_view text, const std::string& file,
                                          int64_t num_gaussians);

}  // namespace pepeseg::client::cli
