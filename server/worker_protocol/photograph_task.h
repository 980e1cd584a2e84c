#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

// The protocol between the server and `pepeseg-worker --photograph=TASK`: the worker reads one
// image file from its standard input and writes one answer to its standard output, a file.
namespace pepeseg {

struct PhotographTask {
  std::string name;    // the owner's name for the file, for errors
  std::string sha256;  // of the file: 64 lower-case hex digits
  // Whether the image is turned upright by its EXIF orientation.
  bool upright = false;
  // The view of a model that the image is warped to, as FormatModelFacts writes a model of this
  // view alone; empty: not warped. Not together with `upright`: views are of the stored pixels.
  std::string view;
  // Longer side of the JPEG, pixels: a larger image is shrunk to it. 0: not shrunk.
  int max_side = 0;
};

std::string FormatPhotographTask(const PhotographTask& task);
// INVALID_ARGUMENT: `text` is not what FormatPhotographTask makes.
absl::StatusOr<PhotographTask> ParsePhotographTask(absl::string_view text);

// The start of an answer. It is followed by `num_bytes` of a JPEG, or of the error's message.
struct PhotographHeader {
  absl::StatusCode code = absl::StatusCode::kOk;
  int width = 0;  // of the JPEG, pixels
  int height = 0;
  int64_t num_bytes = 0;
};
inline constexpr int64_t kPhotographHeaderBytes = 24;
inline constexpr int64_t kMaxPhotographMessageBytes = 1000;

std::string FormatPhotographHeader(const PhotographHeader& header);
// The header at the start of an answer of `file_bytes`. INTERNAL: it is not one, or the answer is
// not as long as it says.
absl::StatusOr<PhotographHeader> ParsePhotographHeader(absl::string_view bytes, int64_t file_bytes);

}  // namespace pepeseg
