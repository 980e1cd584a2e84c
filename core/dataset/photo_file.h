#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/dataset/dataset_files.h"
#include "core/scene/capture.h"
#include "core/scene/model.h"

namespace pepeseg {

// Size in stored pixels and EXIF orientation, [1, 8], of a photograph.
struct PhotoFacts {
  int width = 0, height = 0;
  int orientation = 1;
};

// Reads them without decoding the photograph. Errors as ReadImageSize and ReadFile.
absl::StatusOr<PhotoFacts> ReadPhotoFacts(const DatasetFile& photo);

using PhotoFactsByKey = std::map<std::string, PhotoFacts>;  // by the names in DatasetIndex::photos

// A photograph as it is stored.
struct DecodedPhoto {
  Image image;                       // RGB
  std::vector<uint8_t> transparent;  // see DecodePhoto
  int orientation = 1;               // EXIF orientation, [1, 8]
};

// Reads and decodes a photograph. Errors as DecodePhoto.
absl::StatusOr<DecodedPhoto> ReadPhoto(const DatasetFile& photo);

// Turns a photograph upright. Its orientation becomes 1.
DecodedPhoto Upright(DecodedPhoto photo);

// Decodes the bytes of a photograph, HEIC among them, in that form. Decoders of foreign formats
// run: only processes in a sandbox may call it. Errors as DecodePhoto and
// DecodeHeic, and INVALID_ARGUMENT if the photograph does not have the size that the view expects.
absl::StatusOr<Image> FormPhotograph(std::span<const uint8_t> bytes, absl::string_view name,
                                     const PhotographForm& form);

}  // namespace pepeseg
