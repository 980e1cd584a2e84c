#pragma once

#include <optional>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/query/photograph_frame.h"
#include "core/query/photograph_images.h"
#include "core/query/segmenter.h"
#include "core/scene/capture.h"
#include "core/scene/mask_set.h"
#include "core/scene/model.h"
#include "pepeseg/v1/prompt.pb.h"
#include "pepeseg/v1/segmentation_service.pb.h"

// Images of requests and answers: whose pixels they are in, masks that are read, masks that are
// encoded. Functions with a `field` return INVALID_ARGUMENT that names it, and both sizes where
// they differ.
namespace pepeseg {

// Returns INVALID_ARGUMENT unless `frame` is a value of PixelFrame.
absl::Status CheckFrame(v1::PixelFrame frame);

// The image whose pixels a request and its answer are in: a view's photograph, or the view itself.
struct ImageOfView {
  PhotographFrame frame;  // for PIXEL_FRAME_VIEW its photograph is the view itself
  std::string name;       // for messages: photograph "a.jpg", view "a.jpg", or the free camera
  // EXIF orientation of the photograph's file, [1, 8], where images of a request may be of its
  // stored pixels (core/dataset/pixel_frame.h); else 1.
  int orientation = 1;
  bool is_stored = false;  // images whose size fits both frames are of the stored pixels

  // Returns the size in pixels as text: "640x480".
  std::string Size() const;
  // Returns whether an image of this size fits the stored pixels of a photograph that is turned.
  bool FitsStored(int64_t width, int64_t height) const;
  // Returns the EXIF orientation that turns an image of a request with this size to `frame`; 1: it
  // is not turned.
  int TurnOf(int64_t width, int64_t height) const;
};
ImageOfView ImageOf(const ModelView& view, v1::PixelFrame frame);

// Takes results from the views that were segmented to the frame of a request. Keeps the mapping of
// the last view, since views of one camera mostly follow each other. Not thread safe.
class AnswerFrame {
 public:
  explicit AnswerFrame(v1::PixelFrame frame) : frame_(frame) {}

  // Returns `result`, which is in the pixels of `view`, in the pixels of the frame.
  SegmentResult Take(const ModelView& view, SegmentResult result);

 private:
  v1::PixelFrame frame_;
  std::optional<ViewPlaces> places_;
};

// Width and height of an image in a request, as its header says; 0x0 if there is no header.
struct ImageSize {
  int64_t width = 0, height = 0;

  bool operator==(const ImageSize&) const = default;
};
ImageSize SizeOf(const v1::MaskImage& image);
ImageSize SizeOfPng(const std::string& png);

// Decodes a grey PNG of the size of `image`, or of its stored pixels, from which it is turned. The
// header is checked before anything is decoded.
absl::StatusOr<FloatImage> DecodeGreyOf(const ImageOfView& image, const std::string& png,
                                        const std::string& field);

// Reads a mask of the size of `image`, or of its stored pixels, from which it is turned. It may be
// empty.
absl::StatusOr<BinaryMask> ReadAnyMask(const v1::MaskImage& mask, const ImageOfView& image,
                                       const std::string& field);
// Reads a mask of the size of `image` with at least one pixel.
absl::StatusOr<BinaryMask> ReadMask(const v1::MaskImage& mask, const ImageOfView& image,
                                    const std::string& field);
// Takes a mask that ReadMask returned to the view. Refuses a mask of which the view shows nothing.
absl::StatusOr<BinaryMask> TakeToView(BinaryMask mask, const ImageOfView& image,
                                      const std::string& field);

// Returns the mask at another size, by the nearest pixel.
BinaryMask Resized(const BinaryMask& mask, const ImageSize& from, const ImageSize& to);

v1::CocoRle RleToProto(const BinaryMask& mask, int width, int height);
// Encodes cosines as int16, cosine * 32767, little-endian.
v1::SegmentViewsResponse::SimilarityMap SimilarityToProto(int width, int height,
                                                          std::span<const float> similarity);
// Encodes the result of one view.
absl::StatusOr<v1::SegmentViewsResponse::ViewMask> EncodeMask(const std::string& view,
                                                              const SegmentResult& result,
                                                              v1::MaskEncoding encoding);

}  // namespace pepeseg
