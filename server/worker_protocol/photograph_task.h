#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/model_files/model_file.h"

// The protocol between the server and `pepeseg-worker --photograph=TASK`: the worker reads one
// image file from its standard input and writes one answer to its standard output, a file.
namespace pepeseg {

// How to answer for an image file: with a JPEG, or with its pixels.
struct PhotographTask {
  std::string name;    // the client's path of the file, for errors
  std::string sha256;  // digest of the file: 64 lower-case hex digits
  PhotographForm form;
  // Whether the answer is the RGB values, [height, width, 3], and not a JPEG: a server must not
  // decode what a process that has read a stranger's file has written.
  bool raw = false;
};

std::string FormatPhotographTask(const PhotographTask& task);
// Parses what FormatPhotographTask returns. INVALID_ARGUMENT: `text` is something else.
absl::StatusOr<PhotographTask> ParsePhotographTask(absl::string_view text);

// The start of an answer. `num_bytes` bytes follow: of the JPEG or the pixels if `code` is OK, else
// of the error's message.
struct PhotographHeader {
  absl::StatusCode code = absl::StatusCode::kOk;
  int width = 0;  // size of the image, pixels; 0 with an error
  int height = 0;
  int64_t num_bytes = 0;
};
inline constexpr int64_t kPhotographHeaderBytes = 24;
inline constexpr int64_t kMaxPhotographMessageBytes = 1000;

// Returns kPhotographHeaderBytes bytes.
std::string FormatPhotographHeader(const PhotographHeader& header);
// Parses the header of an answer whose file has `file_bytes` bytes in all. INTERNAL: `bytes` are
// not a header, or the header does not fit the file's size.
absl::StatusOr<PhotographHeader> ParsePhotographHeader(absl::string_view bytes, int64_t file_bytes);

}  // namespace pepeseg
