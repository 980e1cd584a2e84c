#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// The other files that a transforms.json of nerfstudio or instant-ngp names. Paths are relative to
// the folder of the file, with '/' and without ".", ".." and empty parts.
struct TransformsReferences {
  std::string points;  // ply_file_path; empty: none
  struct Frame {
    std::string photo;  // file_path
    std::string mask;   // mask_path of the frame, else of the document; empty: none
  };
  std::vector<Frame> frames;
};

// Parses the text of transforms.json. Fields of another type, and frames without a file_path, are
// skipped. INVALID_ARGUMENT: it is not a JSON object.
absl::StatusOr<TransformsReferences> ParseTransformsReferences(absl::string_view text);

// Returns the path with '/' and without ".", ".." and empty parts: "..\\data\\.\\images\\7" becomes
// "data/images/7".
std::string PlainPath(const std::string& path);

}  // namespace pepeseg
