#include "server/api/request_image.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "core/base/status_macros.h"
#include "core/dataset/pixel_frame.h"
#include "core/formats/image_header.h"
#include "core/formats/images.h"
#include "core/formats/rle.h"
#include "server/api/error.h"

namespace pepeseg {
namespace {

absl::Status CheckSize(const ImageSize& size, const Frame& frame, const std::string& field) {
  if (size == ImageSize{frame.width(), frame.height()}) return absl::OkStatus();
  if (frame.FitsStored(size.width, size.height)) return absl::OkStatus();
  std::string what = absl::StrCat("pixels; ", frame.image().name, " has ", frame.image().Size());
  // The usual mistake: a mask of the view where one of the photograph is expected.
  if (size == ImageSize{frame.camera().width, frame.camera().height}) {
    absl::StrAppend(&what, "; for pixels of the view ask with frame PIXEL_FRAME_VIEW");
  } else if (size == ImageSize{frame.height(), frame.width()}) {
    absl::StrAppend(&what,
                    "; pixels are those of the upright photograph, as viewers show it: turn the "
                    "image by the photograph's EXIF orientation");
  }
  return BadField(field, absl::StrCat(size.width, "x", size.height), what);
}

// Returns the header of a PNG. Refuses other formats and images that are cut off.
absl::StatusOr<ImageHeader> ReadPngHeader(const std::string& png, const std::string& name,
                                          const std::string& field) {
  const std::span bytes(reinterpret_cast<const uint8_t*>(png.data()), png.size());
  const auto header = ReadImageHeader(name, bytes);
  // Masks are PNG or RLE only: JPEG would blur their borders.
  if (header.ok() && header->format == ImageFormat::kPng) return header;
  return BadField(field, name, "not a whole PNG");
}

absl::StatusOr<BinaryMask> MaskFromRle(const v1::CocoRle& rle, const Frame& frame,
                                       const std::string& field) {
  // First, since the size decides how much memory the pixels take. The runs are text of any length.
  RETURN_IF_ERROR(CheckSize({rle.width(), rle.height()}, frame, field));
  const auto refused = [&](const absl::Status& status) {
    return BadField(field + ".counts", rle.counts(), std::string(status.message()));
  };
  const auto counts = ParseCocoCounts(rle.counts());
  if (!counts.ok()) return refused(counts.status());
  const auto pixels = PixelsOfRuns(*counts, rle.width(), rle.height());
  if (!pixels.ok()) return refused(pixels.status());
  BinaryMask mask = {std::vector<uint8_t>(static_cast<size_t>(rle.width()) * rle.height())};
  for (const uint32_t pixel : *pixels) mask.pixels[pixel] = 1;
  const int turn = frame.TurnOf(rle.width(), rle.height());
  mask.pixels = Turned(mask.pixels, rle.width(), rle.height(), turn);
  return mask;
}

absl::StatusOr<BinaryMask> MaskFromPng(const std::string& png, const Frame& frame,
                                       const std::string& field) {
  RETURN_IF_ERROR(AtField(CheckMaskBytes(png.size()), field));
  ASSIGN_OR_RETURN(const FloatImage grey, DecodeGreyOf(frame, png, field));
  BinaryMask mask;
  mask.pixels.reserve(grey.values.size());
  for (const float value : grey.values) mask.pixels.push_back(value != 0 ? 1 : 0);
  return mask;
}

v1::SegmentViewsResponse::BorderImage ToProto(BorderImage image) {
  switch (image) {
    case BorderImage::kNone:
      break;
    case BorderImage::kPhotograph:
      return v1::SegmentViewsResponse::BORDER_IMAGE_PHOTOGRAPH;
    case BorderImage::kRendering:
      return v1::SegmentViewsResponse::BORDER_IMAGE_RENDERING;
  }
  return v1::SegmentViewsResponse::BORDER_IMAGE_UNSPECIFIED;
}

}  // namespace

absl::Status CheckFrame(v1::PixelFrame frame) {
  if (v1::PixelFrame_IsValid(frame)) return absl::OkStatus();
  return BadField("frame", absl::StrCat(static_cast<int>(frame)), "not a frame of pixels");
}

FrameKind FrameKindFromProto(v1::PixelFrame frame) {
  return frame == v1::PIXEL_FRAME_VIEW ? FrameKind::kView : FrameKind::kPhotograph;
}

ImageSize SizeOf(const v1::MaskImage& image) {
  if (image.has_rle()) return {image.rle().width(), image.rle().height()};
  return SizeOfPng(image.png());
}

ImageSize SizeOfPng(const std::string& png) {
  const auto header = ReadPngHeader(png, "", "");
  return header.ok() ? ImageSize{header->width, header->height} : ImageSize{};
}

absl::StatusOr<FloatImage> DecodeGreyOf(const Frame& frame, const std::string& png,
                                        const std::string& field) {
  const std::string& name = frame.image().name;
  ASSIGN_OR_RETURN(const ImageHeader header, ReadPngHeader(png, name, field));
  // A small PNG can declare billions of pixels: nothing is decoded before its size is that of a
  // known image.
  RETURN_IF_ERROR(CheckSize({header.width, header.height}, frame, field));
  const std::span bytes(reinterpret_cast<const uint8_t*>(png.data()), png.size());
  auto decoded = DecodeGrey(bytes, name);
  if (decoded.ok()) return Turned(*decoded, frame.TurnOf(header.width, header.height));
  // The message names the image, as the field's error does.
  absl::string_view why = decoded.status().message();
  absl::ConsumePrefix(&why, absl::StrCat(name, ": "));
  return BadField(field, name, std::string(why));
}

absl::StatusOr<BinaryMask> ReadMask(const v1::MaskImage& mask, const Frame& frame,
                                    const std::string& field) {
  if (mask.image_case() == v1::MaskImage::kRle)
    return MaskFromRle(mask.rle(), frame, field + ".rle");
  if (mask.image_case() == v1::MaskImage::kPng)
    return MaskFromPng(mask.png(), frame, field + ".png");
  return BadField(field, "", "neither RLE nor PNG");
}

v1::CocoRle RleToProto(const BinaryMask& mask, int width, int height) {
  v1::CocoRle rle;
  rle.set_width(width);
  rle.set_height(height);
  rle.set_counts(EncodeCocoRle(mask, width, height));
  return rle;
}

v1::SegmentViewsResponse::SimilarityMap SimilarityToProto(int width, int height,
                                                          std::span<const float> similarity) {
  v1::SegmentViewsResponse::SimilarityMap proto;
  proto.set_width(width);
  proto.set_height(height);
  std::string& bytes = *proto.mutable_values();
  bytes.reserve(similarity.size() * 2);
  for (float cosine : similarity) {
    const auto value =
        static_cast<uint16_t>(std::lround(std::clamp(cosine, -1.0f, 1.0f) * 32767.0f));
    bytes.push_back(static_cast<char>(value & 0xff));
    bytes.push_back(static_cast<char>(value >> 8));
  }
  return proto;
}

absl::StatusOr<v1::SegmentViewsResponse::ViewMask> EncodeMask(const SegmentResult& result,
                                                              v1::MaskEncoding encoding) {
  v1::SegmentViewsResponse::ViewMask mask;
  mask.set_view(result.view);
  if (encoding == v1::MASK_ENCODING_PNG) {
    Image image{result.width, result.height, 1, result.mask.pixels};
    // White on black, so that people can look at the mask.
    for (uint8_t& pixel : image.pixels) pixel = pixel != 0 ? 255 : 0;
    ASSIGN_OR_RETURN(*mask.mutable_png(), EncodePng(image));
  } else {
    *mask.mutable_rle() = RleToProto(result.mask, result.width, result.height);
  }
  mask.set_score(result.score);
  mask.mutable_box()->set_x(result.box[0]);
  mask.mutable_box()->set_y(result.box[1]);
  mask.mutable_box()->set_width(result.box[2]);
  mask.mutable_box()->set_height(result.box[3]);
  mask.set_area(result.area);
  mask.set_border_image(ToProto(result.border_image));
  if (!result.similarity.empty()) {
    *mask.mutable_similarity() = SimilarityToProto(result.width, result.height, result.similarity);
  }
  return mask;
}

}  // namespace pepeseg
