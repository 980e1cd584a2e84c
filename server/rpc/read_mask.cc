#include "server/rpc/read_mask.h"

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/io/decode_image.h"
#include "core/io/image_header.h"
#include "core/io/rle.h"
#include "core/status_macros.h"
#include "server/rpc/error.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxPngBytes = size_t{4} << 20;

absl::Status CheckSize(int64_t width, int64_t height, const ModelView& view,
                       const std::string& field) {
  const Camera& camera = view.camera;
  if (width == camera.width && height == camera.height) return absl::OkStatus();
  return BadField(field, absl::StrCat(width, "x", height),
                  absl::StrCat("pixels; view ", view.name, " has ", camera.width, "x",
                               camera.height, " in the model"));
}

absl::StatusOr<BinaryMask> MaskFromRle(const v1::CocoRle& rle, const ModelView& view,
                                       const std::string& field) {
  RETURN_IF_ERROR(CheckSize(rle.width(), rle.height(), view, field));
  const auto refused = [&](const absl::Status& status) {
    return BadField(field + ".counts", rle.counts(), std::string(status.message()));
  };
  const auto counts = ParseCocoCounts(rle.counts());
  if (!counts.ok()) return refused(counts.status());
  const auto pixels = PixelsOfRuns(*counts, rle.width(), rle.height());
  if (!pixels.ok()) return refused(pixels.status());
  BinaryMask mask = {std::vector<uint8_t>(static_cast<size_t>(rle.width()) * rle.height())};
  for (const uint32_t pixel : *pixels) mask.pixels[pixel] = 1;
  return mask;
}

absl::StatusOr<BinaryMask> MaskFromPng(const std::string& png, const ModelView& view,
                                       const std::string& field) {
  if (png.size() > kMaxPngBytes) {
    return BadField(field, absl::StrCat(png.size()),
                    absl::StrCat("bytes; allowed are ", kMaxPngBytes));
  }
  ASSIGN_OR_RETURN(const FloatImage grey, DecodeGreyOf(view, png, field));
  BinaryMask mask;
  mask.pixels.reserve(grey.values.size());
  for (const float value : grey.values) mask.pixels.push_back(value != 0 ? 1 : 0);
  return mask;
}

}  // namespace

absl::StatusOr<FloatImage> DecodeGreyOf(const ModelView& view, const std::string& png,
                                        const std::string& field) {
  const std::span bytes(reinterpret_cast<const uint8_t*>(png.data()), png.size());
  const auto header = ReadImageHeader(view.name, bytes);
  if (!header.ok() || header->format != ImageFormat::kPng) {
    return BadField(field, view.name, "not a whole PNG");
  }
  RETURN_IF_ERROR(CheckSize(header->width, header->height, view, field));
  auto image = DecodeGrey(bytes, view.name);
  if (!image.ok()) return BadField(field, view.name, std::string(image.status().message()));
  return image;
}

absl::StatusOr<BinaryMask> ReadMask(const v1::MaskImage& image, const ModelView& view,
                                    const std::string& field) {
  absl::StatusOr<BinaryMask> mask = BadField(field, "", "neither RLE nor PNG");
  if (image.image_case() == v1::MaskImage::kRle) {
    mask = MaskFromRle(image.rle(), view, field + ".rle");
  } else if (image.image_case() == v1::MaskImage::kPng) {
    mask = MaskFromPng(image.png(), view, field + ".png");
  }
  RETURN_IF_ERROR(mask.status());
  if (std::count(mask->pixels.begin(), mask->pixels.end(), 1) == 0) {
    return BadField(field, "", "no pixel is in the mask");
  }
  return mask;
}

}  // namespace pepeseg
