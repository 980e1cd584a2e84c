#pragma once

#include <span>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/query/scene_model.h"
#include "pepeseg/v1/prompt.pb.h"
#include "pepeseg/v1/segmentation_service.pb.h"

// Images of requests and answers: whose pixels they are in, masks that are read, masks that are
// encoded. Functions with a `field` return INVALID_ARGUMENT that names it, and both sizes where
// they differ.
namespace pepeseg {

// Returns INVALID_ARGUMENT unless `frame` is a value of PixelFrame.
absl::Status CheckFrame(v1::PixelFrame frame);
FrameKind FrameKindFromProto(v1::PixelFrame frame);

// Return the size of an image in a request, as its header says; 0x0 if there is no header.
ImageSize SizeOf(const v1::MaskImage& image);
ImageSize SizeOfPng(const std::string& png);

// Decodes a grey PNG of the size of the frame, or of its stored pixels, from which it is turned.
// The header is checked before anything is decoded.
absl::StatusOr<FloatImage> DecodeGreyOf(const Frame& frame, const std::string& png,
                                        const std::string& field);

// Reads a mask of the size of the frame, or of its stored pixels, from which it is turned. It may
// be empty.
absl::StatusOr<BinaryMask> ReadMask(const v1::MaskImage& mask, const Frame& frame,
                                    const std::string& field);

v1::CocoRle RleToProto(const BinaryMask& mask, int width, int height);
// Encodes cosines as int16, cosine * 32767, little-endian.
v1::SegmentViewsResponse::SimilarityMap SimilarityToProto(int width, int height,
                                                          std::span<const float> similarity);
// Encodes the result of one view.
absl::StatusOr<v1::SegmentViewsResponse::ViewMask> EncodeMask(const SegmentResult& result,
                                                              v1::MaskEncoding encoding);

}  // namespace pepeseg
