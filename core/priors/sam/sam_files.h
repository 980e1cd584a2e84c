#pragma once

#include <filesystem>

#include "absl/status/status.h"

namespace pepeseg {

// The files of a folder that deploy/sam.sh has made.
inline constexpr char kSamEncoder[] = "encoder.onnx", kSamDecoder[] = "sam.onnx",
                      kSamRuntime[] = "libonnxruntime.so.1", kSamDigests[] = "SHA256SUMS";
// Where an operator has put an ONNX Runtime with CUDA: its provider, for which there is no digest.
inline constexpr char kSamCudaProvider[] = "libonnxruntime_providers_cuda.so";

// Whether the files are there and what the folder's SHA256SUMS says, a line "DIGEST  NAME" a file.
// NOT_FOUND: there is no such folder, or it has no SHA256SUMS; FAILED_PRECONDITION names the file
// that is missing or differs, and the remedy. Reads 90 MB.
absl::Status CheckSamFiles(const std::filesystem::path& folder);

}  // namespace pepeseg
