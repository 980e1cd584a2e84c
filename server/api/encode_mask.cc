#include "server/api/encode_mask.h"

#include "core/base/status_macros.h"
#include "core/formats/encode_png.h"
#include "core/formats/rle.h"
#include "server/api/convert.h"

namespace pepeseg {

absl::StatusOr<v1::SegmentResponse::ViewMask> EncodeMask(const std::string& view,
                                                         const SegmentResult& result,
                                                         v1::MaskEncoding encoding) {
  v1::SegmentResponse::ViewMask mask;
  mask.set_view(view);
  if (encoding == v1::MASK_ENCODING_PNG) {
    Image image{result.width, result.height, 1, result.mask.pixels};
    for (uint8_t& pixel : image.pixels) pixel = pixel != 0 ? 255 : 0;
    ASSIGN_OR_RETURN(*mask.mutable_png(), EncodePng(image));
  } else {
    v1::CocoRle& rle = *mask.mutable_rle();
    rle.set_height(result.height);
    rle.set_width(result.width);
    rle.set_counts(EncodeCocoRle(result.mask, result.width, result.height));
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
