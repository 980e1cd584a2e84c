#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "kernels/half.h"

namespace pepeseg {

// What SAM's decoder needs of an image: the answer of the encoder, rounded to Halves. 2 MB.
struct SamEmbedding {
  int width = 0, height = 0;  // of the image that prompts and masks refer to, pixels
  std::vector<Half> values;   // [places, channels], places in reading order
};

// Files of embeddings, little-endian without padding:
//   char[8]   "PPSGEMBD"
//   uint32    version: 1
//   uint32    width, height of the image, pixels
//   uint32    number of values
//   char[64]  SHA-256 of encoder.onnx
//   char[64]  SHA-256 of the photograph's file; zeros: it is not known
//   float16   values
//   uint32    CRC-32C of all bytes before

// Size of a file for SAM's 64 x 64 places of 256 channels, bytes.
inline constexpr int64_t kEmbeddingFileBytes = (int64_t{2} << 20) + 156;

// Source of an embedding: SHA-256 as 64 hexadecimal digits.
struct EmbeddingOrigin {
  std::string encoder;
  std::string photograph;  // of the uploaded file; empty: not known, as for a frame of a video
};

// Returns the name of the file for the photograph with this name (PhotoKey), without a folder. It
// has no letters of `photograph`, which is a client's text.
std::string EmbeddingFileName(absl::string_view photograph);

// Writes a file under its name at once. Does not sync it: a file that a loss of power cuts off is
// damaged, and is ignored. Returns the errors of FileError.
absl::Status WriteEmbedding(const std::filesystem::path& path, const SamEmbedding& embedding,
                            const EmbeddingOrigin& origin);

// Reads a file that need not be trusted. An empty `origin.photograph` fits every file. NOT_FOUND:
// there is no such file. DATA_LOSS: it is damaged, or a value is not finite. FAILED_PRECONDITION:
// it is of another encoder or photograph.
absl::StatusOr<SamEmbedding> ReadEmbedding(const std::filesystem::path& path,
                                           const EmbeddingOrigin& origin);

}  // namespace pepeseg
