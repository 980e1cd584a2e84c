#include "server/store/quota_error.h"

#include "absl/strings/cord.h"
#include "absl/strings/str_cat.h"
#include "pepeseg/v1/errors.pb.h"

namespace pepeseg {

absl::Status QuotaError(const std::string& name, int64_t need, int64_t limit) {
  v1::ErrorDetail detail;
  detail.set_reason("QUOTA");
  detail.set_field(name);
  detail.set_value(absl::StrCat(need));
  detail.set_limit(absl::StrCat(limit));
  absl::Status status = absl::ResourceExhaustedError(
      absl::StrCat("the project's quota of ", name, " is ", limit, ", this would make it ", need,
                   ": delete what is not needed, or ask who runs the server for more"));
  status.SetPayload(absl::StrCat("type.googleapis.com/", detail.GetTypeName()),
                    absl::Cord(detail.SerializeAsString()));
  return status;
}

}  // namespace pepeseg
