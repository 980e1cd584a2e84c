#include "clients/cpp/answer_status.h"

#include <string>

#include "absl/strings/cord.h"
#include "absl/types/optional.h"
#include "clients/cpp/intermediary.h"

namespace pepeseg::client {
namespace {

constexpr char kDetailUrl[] = "type.googleapis.com/pepeseg.v1.ErrorDetail";

}  // namespace

absl::Status FromGrpc(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  absl::Status result(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
  v1::Status details;
  v1::ErrorDetail detail;
  if (details.ParseFromString(status.error_details()) && details.details_size() > 0 &&
      details.details(0).UnpackTo(&detail)) {
    result.SetPayload(kDetailUrl, absl::Cord(detail.SerializeAsString()));
    return result;
  }
  return FromIntermediary(result);
}

std::optional<v1::ErrorDetail> DetailOf(const absl::Status& status) {
  const absl::optional<absl::Cord> payload = status.GetPayload(kDetailUrl);
  v1::ErrorDetail detail;
  if (!payload || !detail.ParseFromString(std::string(*payload))) return std::nullopt;
  return detail;
}

}  // namespace pepeseg::client
