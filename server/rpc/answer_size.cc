#include "server/rpc/answer_size.h"

#include "absl/strings/str_cat.h"
#include "server/rpc/error.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxAnswerBytes = size_t{4} << 20;

}  // namespace

absl::Status CheckAnswerSize(size_t num_bytes) {
  if (num_bytes <= kMaxAnswerBytes) return absl::OkStatus();
  v1::ErrorDetail detail;
  detail.set_reason("ANSWER_TOO_LARGE");
  detail.set_value(absl::StrCat(num_bytes, " bytes"));
  detail.set_limit(absl::StrCat(kMaxAnswerBytes, " bytes"));
  return WithDetail(
      absl::ResourceExhaustedError(absl::StrCat("the answer has over ", kMaxAnswerBytes,
                                                " bytes: ask for fewer or smaller views")),
      detail);
}

}  // namespace pepeseg
