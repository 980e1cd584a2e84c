#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/dataset/dataset_files.h"
#include "core/scene/capture.h"

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

}  // namespace pepeseg
