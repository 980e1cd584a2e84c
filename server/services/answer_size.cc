#include "server/services/answer_size.h"

#include "absl/strings/str_cat.h"
#include "server/api/error.h"

namespace pepeseg {

absl::Status CheckAnswerSize(size_t num_bytes) {
  if (num_bytes <= kAnswerBytes) return absl::OkStatus();
  v1::ErrorDetail detail;
  detail.set_reason("ANSWER_TOO_LARGE");
  detail.set_value(absl::StrCat(num_bytes, " bytes"));
  detail.set_limit(absl::StrCat(kAnswerBytes, " bytes"));
  return WithDetail(absl::ResourceExhaustedError(absl::StrCat(
                        "the answer has over ", kAnswerBytes, " bytes: ask for fewer views, for ",
                        "frame PIXEL_FRAME_VIEW, or for a smaller max_side")),
                    detail);
}

}  // namespace pepeseg
