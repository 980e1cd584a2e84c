#include "core/dataset/photo_file.h"

#include <span>
#include <string>
#include <utility>

#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/dataset/pixel_frame.h"
#include "core/formats/exif.h"
#include "core/formats/image_header.h"
#include "core/formats/images.h"

namespace pepeseg {
namespace {

std::span<const uint8_t> Span(const std::string& bytes) {
  return {reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()};
}

}  // namespace

absl::StatusOr<PhotoFacts> ReadPhotoFacts(const DatasetFile& photo) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(photo.path, photo.name, kMaxImageFileBytes));
  ASSIGN_OR_RETURN(const ImageHeader header, ReadImageSize(photo.path, photo.name));
  return PhotoFacts{header.width, header.height, ReadExifOrientation(Span(bytes))};
}

absl::StatusOr<DecodedPhoto> ReadPhoto(const DatasetFile& photo) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(photo.path, photo.name, kMaxImageFileBytes));
  DecodedPhoto decoded;
  ASSIGN_OR_RETURN(decoded.image, DecodePhoto(Span(bytes), photo.name, &decoded.transparent));
  decoded.orientation = ReadExifOrientation(Span(bytes));
  return decoded;
}

DecodedPhoto Upright(DecodedPhoto photo) {
  if (!photo.transparent.empty()) {
    photo.transparent =
        Turned(photo.transparent, photo.image.width, photo.image.height, photo.orientation);
  }
  photo.image = Upright(std::move(photo.image), photo.orientation);
  photo.orientation = 1;
  return photo;
}

}  // namespace pepeseg
