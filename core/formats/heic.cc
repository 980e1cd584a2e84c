#include "core/formats/heic.h"

#include <libheif/heif.h>

#include <cstring>
#include <memory>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "core/formats/exif.h"
#include "core/formats/image_header.h"
#include "core/formats/images.h"

namespace pepeseg {
namespace {

constexpr int kHeicJpegQuality = 95;
// libheif limits the number of pixels to the square of this, which is kMaxImagePixels.
constexpr int kMaxHeicSide = 8000;
static_assert(int64_t{kMaxHeicSide} * kMaxHeicSide == kMaxImagePixels);
constexpr size_t kMaxHeicExifBytes = 60'000;  // fits in one segment of a JPEG

// Frees the objects of libheif's C interface.
struct HeicDeleter {
  void operator()(heif_context* context) const { heif_context_free(context); }
  void operator()(heif_image_handle* handle) const { heif_image_handle_release(handle); }
  void operator()(heif_image* image) const { heif_image_release(image); }
};
using HeicContext = std::unique_ptr<heif_context, HeicDeleter>;
using HeicHandle = std::unique_ptr<heif_image_handle, HeicDeleter>;
using HeicImage = std::unique_ptr<heif_image, HeicDeleter>;

// Converts an error of libheif to INVALID_ARGUMENT.
absl::Status CheckHeif(const heif_error& error, absl::string_view name) {
  if (error.code == heif_error_Ok) return absl::OkStatus();
  return Refused(name, absl::StrCat("does not decode: ", error.message));
}

// Copies the decoded pixels without the padding of their scanlines, after comparing the size with
// the header's.
absl::StatusOr<Image> CopyPixels(const heif_image* decoded, const ImageHeader& header,
                                 absl::string_view name) {
  const int width = heif_image_get_width(decoded, heif_channel_interleaved);
  const int height = heif_image_get_height(decoded, heif_channel_interleaved);
  int stride = 0;
  const uint8_t* pixels = heif_image_get_plane_readonly(decoded, heif_channel_interleaved, &stride);
  if (pixels == nullptr || width != header.width || height != header.height || stride < 3 * width) {
    return Refused(name, absl::StrCat("its header says ", header.width, "x", header.height,
                                      ", it decodes to ", width, "x", height));
  }
  Image image{width, height, 3, {}};
  image.pixels.resize(static_cast<size_t>(width) * height * 3);
  for (int y = 0; y < height; ++y) {
    std::memcpy(image.pixels.data() + static_cast<size_t>(y) * width * 3,
                pixels + static_cast<size_t>(y) * stride, static_cast<size_t>(width) * 3);
  }
  return image;
}

// Returns the TIFF structure of the EXIF data; empty if there is none or it is too large.
std::string ReadHeicExif(const heif_image_handle* handle) {
  constexpr size_t kOffsetBytes = 4;  // a big-endian offset to the TIFF structure, from its own end
  heif_item_id id = 0;
  if (heif_image_handle_get_list_of_metadata_block_IDs(handle, "Exif", &id, 1) < 1) return "";
  const size_t size = heif_image_handle_get_metadata_size(handle, id);
  if (size <= kOffsetBytes || size > kMaxHeicExifBytes) return "";
  std::string data(size, '\0');
  if (heif_image_handle_get_metadata(handle, id, data.data()).code != heif_error_Ok) return "";
  size_t offset = kOffsetBytes;
  for (size_t i = 0; i < kOffsetBytes; ++i) {
    offset += size_t{static_cast<uint8_t>(data[i])} << (8 * (kOffsetBytes - 1 - i));
  }
  return offset < data.size() ? data.substr(offset) : "";
}

}  // namespace

absl::StatusOr<HeicPhoto> DecodeHeic(std::span<const uint8_t> bytes, absl::string_view name) {
  ASSIGN_OR_RETURN(const ImageHeader header, ReadImageHeader(name, bytes));
  if (header.format != ImageFormat::kHeic) return Refused(name, "not a HEIC photograph");
  // Limits libheif itself as well: the decoded size may differ from the header's.
  const HeicContext context(heif_context_alloc());
  heif_context_set_maximum_image_size_limit(context.get(), kMaxHeicSide);
  // The caller decides how many photographs are decoded at once.
  heif_context_set_max_decoding_threads(context.get(), 1);
  RETURN_IF_ERROR(CheckHeif(heif_context_read_from_memory_without_copy(context.get(), bytes.data(),
                                                                       bytes.size(), nullptr),
                            name));
  heif_image_handle* primary = nullptr;
  RETURN_IF_ERROR(CheckHeif(heif_context_get_primary_image_handle(context.get(), &primary), name));
  const HeicHandle handle(primary);
  heif_image* made = nullptr;
  RETURN_IF_ERROR(CheckHeif(heif_decode_image(handle.get(), &made, heif_colorspace_RGB,
                                              heif_chroma_interleaved_RGB, nullptr),
                            name));
  const HeicImage decoded(made);
  HeicPhoto photo;
  ASSIGN_OR_RETURN(photo.image, CopyPixels(decoded.get(), header, name));
  photo.exif = ReadHeicExif(handle.get());
  return photo;
}

absl::StatusOr<std::string> HeicToJpeg(std::span<const uint8_t> bytes, absl::string_view name) {
  ASSIGN_OR_RETURN(const HeicPhoto photo, DecodeHeic(bytes, name));
  ASSIGN_OR_RETURN(std::string jpeg, EncodeJpeg(photo.image, kHeicJpegQuality));
  return photo.exif.empty() ? jpeg : WithUprightExif(std::move(jpeg), photo.exif);
}

}  // namespace pepeseg
