#pragma once

#include <filesystem>

#include "absl/status/status.h"

namespace pepeseg {

// Files of a folder that deploy/sam.sh has made.
inline constexpr char kSamEncoder[] = "encoder.onnx", kSamDecoder[] = "sam.onnx",
                      kSamRuntime[] = "libonnxruntime.so.1", kSamDigests[] = "SHA256SUMS";
// CUDA provider of ONNX Runtime, which an operator may add to the folder. It has no digest.
inline constexpr char kSamCudaProvider[] = "libonnxruntime_providers_cuda.so";

// Verifies the three files against the folder's SHA256SUMS, which has a line "DIGEST  NAME" for
// each. Returns NOT_FOUND when the folder or its SHA256SUMS does not exist, and
// FAILED_PRECONDITION, with the file and the remedy, when a file is missing or differs. Reads 90
// MB.
absl::Status CheckSamFiles(const std::filesystem::path& folder);

}  // namespace pepeseg
