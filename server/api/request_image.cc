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
#include "core/formats/decode_image.h"
#include "core/formats/encode_png.h"
#include "core/formats/image_header.h"
#include "core/formats/rle.h"
#include "core/query/photograph_images.h"
#include "server/api/error.h"

namespace pepeseg {
namespace {

// Maximum size of a mask in a request, before it is decoded.
constexpr size_t kMaxPngBytes = size_t{4} << 20;

absl::Status CheckSize(const ImageSize& size, const ImageOfView& image, const std::string& field) {
  const PhotographFrame& frame = image.frame;
  if (size == ImageSize{frame.width(), frame.height()}) return absl::OkStatus();
  if (image.FitsStored(size.width, size.height)) return absl::OkStatus();
  std::string what = absl::StrCat("pixels; ", image.name, " has ", image.Size());
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

absl::StatusOr<BinaryMask> MaskFromRle(const v1::CocoRle& rle, const ImageOfView& image,
                                       const std::string& field) {
  // First, since the size decides how much memory the pixels take. The runs are text of any length.
  RETURN_IF_ERROR(CheckSize({rle.width(), rle.height()}, image, field));
  const auto refused = [&](const absl::Status& status) {
    return BadField(field + ".counts", rle.counts(), std::string(status.message()));
  };
  const auto counts = ParseCocoCounts(rle.counts());
  if (!counts.ok()) return refused(counts.status());
  const auto pixels = PixelsOfRuns(*counts, rle.width(), rle.height());
  if (!pixels.ok()) return refused(pixels.status());
  BinaryMask mask = {std::vector<uint8_t>(static_cast<size_t>(rle.width()) * rle.height())};
  for (const uint32_t pixel : *pixels) mask.pixels[pixel] = 1;
  const int turn = image.TurnOf(rle.width(), rle.height());
  mask.pixels = Turned(mask.pixels, rle.width(), rle.height(), turn);
  return mask;
}

absl::StatusOr<BinaryMask> MaskFromPng(const std::string& png, const ImageOfView& image,
                                       const std::string& field) {
  if (png.size() > kMaxPngBytes) {
    return BadField(field, absl::StrCat(png.size()),
                    absl::StrCat("bytes; allowed are ", kMaxPngBytes));
  }
  ASSIGN_OR_RETURN(const FloatImage grey, DecodeGreyOf(image, png, field));
  BinaryMask mask;
  mask.pixels.reserve(grey.values.size());
  for (const float value : grey.values) mask.pixels.push_back(value != 0 ? 1 : 0);
  return mask;
}

}  // namespace

absl::Status CheckFrame(v1::PixelFrame frame) {
  if (v1::PixelFrame_IsValid(frame)) return absl::OkStatus();
  return BadField("frame", absl::StrCat(static_cast<int>(frame)), "not a frame of pixels");
}

std::string ImageOfView::Size() const { return absl::StrCat(frame.width(), "x", frame.height()); }

bool ImageOfView::FitsStored(int64_t width, int64_t height) const {
  constexpr int kFirstTransposed = 5;  // EXIF orientations from here on exchange the sides
  if (orientation == 1) return false;
  return orientation < kFirstTransposed ? width == frame.width() && height == frame.height()
                                        : width == frame.height() && height == frame.width();
}

int ImageOfView::TurnOf(int64_t width, int64_t height) const {
  const bool fits_frame = width == frame.width() && height == frame.height();
  return FitsStored(width, height) && (is_stored || !fits_frame) ? orientation : 1;
}

ImageOfView ImageOf(const ModelView& view, v1::PixelFrame frame) {
  if (view.name.empty()) return {PhotographFrame(view), "the free camera"};
  if (frame != v1::PIXEL_FRAME_VIEW) {
    return {PhotographFrame(view), absl::StrCat("photograph \"", view.name, "\"")};
  }
  // Without its photograph a view is its own frame, so that no pixel is warped.
  ModelView alone = view;
  alone.photograph.reset();
  return {PhotographFrame(alone), absl::StrCat("view \"", view.name, "\"")};
}

SegmentResult AnswerFrame::Take(const ModelView& view, SegmentResult result) {
  const PhotographFrame frame = ImageOf(view, frame_).frame;
  if (frame.is_view()) return result;
  // The mapping costs a search for each pixel, so it is kept while the frame stays the same.
  if (!places_ || places_->frame() != frame) places_.emplace(frame, frame.width(), frame.height());
  return InPhotograph(result, *places_);
}

ImageSize SizeOf(const v1::MaskImage& image) {
  if (image.has_rle()) return {image.rle().width(), image.rle().height()};
  return SizeOfPng(image.png());
}

ImageSize SizeOfPng(const std::string& png) {
  const auto header = ReadPngHeader(png, "", "");
  return header.ok() ? ImageSize{header->width, header->height} : ImageSize{};
}

absl::StatusOr<FloatImage> DecodeGreyOf(const ImageOfView& image, const std::string& png,
                                        const std::string& field) {
  ASSIGN_OR_RETURN(const ImageHeader header, ReadPngHeader(png, image.name, field));
  // A small PNG can declare billions of pixels: nothing is decoded before its size is that of a
  // known image.
  RETURN_IF_ERROR(CheckSize({header.width, header.height}, image, field));
  const std::span bytes(reinterpret_cast<const uint8_t*>(png.data()), png.size());
  auto decoded = DecodeGrey(bytes, image.name);
  if (decoded.ok()) return Turned(*decoded, image.TurnOf(header.width, header.height));
  // The message names the image, as the field's error does.
  absl::string_view why = decoded.status().message();
  absl::ConsumePrefix(&why, absl::StrCat(image.name, ": "));
  return BadField(field, image.name, std::string(why));
}

absl::StatusOr<BinaryMask> ReadAnyMask(const v1::MaskImage& mask, const ImageOfView& image,
                                       const std::string& field) {
  if (mask.image_case() == v1::MaskImage::kRle)
    return MaskFromRle(mask.rle(), image, field + ".rle");
  if (mask.image_case() == v1::MaskImage::kPng)
    return MaskFromPng(mask.png(), image, field + ".png");
  return BadField(field, "", "neither RLE nor PNG");
}

absl::StatusOr<BinaryMask> ReadMask(const v1::MaskImage& mask, const ImageOfView& image,
                                    const std::string& field) {
  ASSIGN_OR_RETURN(BinaryMask read, ReadAnyMask(mask, image, field));
  // An empty mask selects nothing, and its mean feature would be undefined.
  if (std::count(read.pixels.begin(), read.pixels.end(), 1) == 0) {
    return BadField(field, "", "no pixel is in the mask");
  }
  return read;
}

absl::StatusOr<BinaryMask> TakeToView(BinaryMask mask, const ImageOfView& image,
                                      const std::string& field) {
  BinaryMask in_view = {image.frame.TakeToView(std::move(mask.pixels))};
  if (std::count(in_view.pixels.begin(), in_view.pixels.end(), 1) > 0) return in_view;
  return BadField(field, "",
                  absl::StrCat("no pixel of the mask is in the part of ", image.name,
                               " that the model was trained on, or the mask is too small for it"));
}

BinaryMask Resized(const BinaryMask& mask, const ImageSize& from, const ImageSize& to) {
  if (from == to) return mask;
  BinaryMask resized;
  resized.pixels.reserve(static_cast<size_t>(to.width * to.height));
  for (int64_t y = 0; y < to.height; ++y) {
    // The source pixel under the centre of the target pixel: (y + 1/2) * from / to, rounded down.
    const int64_t row = (2 * y + 1) * from.height / (2 * to.height);
    for (int64_t x = 0; x < to.width; ++x) {
      const int64_t column = (2 * x + 1) * from.width / (2 * to.width);
      resized.pixels.push_back(mask.pixels[row * from.width + column]);
    }
  }
  return resized;
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

absl::StatusOr<v1::SegmentViewsResponse::ViewMask> EncodeMask(const std::string& view,
                                                              const SegmentResult& result,
                                                              v1::MaskEncoding encoding) {
  v1::SegmentViewsResponse::ViewMask mask;
  mask.set_view(view);
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
  if (!result.similarity.empty()) {
    *mask.mutable_similarity() = SimilarityToProto(result.width, result.height, result.similarity);
  }
  return mask;
}

}  // namespace pepeseg
