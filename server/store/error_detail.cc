#include "server/store/error_detail.h"

#include <cstdint>
#include <map>

#include "absl/strings/cord.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "pepeseg/v1/errors.pb.h"

namespace pepeseg {
namespace {

using google::protobuf::Any;

constexpr char kDomain[] = "pepeseg";
constexpr char kLimit[] = "limit";
constexpr char kValue[] = "value";

// Our messages have the names and fields of those of google.rpc, so they are sent as those.
template <typename Message>
std::string TypeUrl() {
  return absl::StrCat("type.googleapis.com/google.rpc.", Message::descriptor()->name());
}

template <typename Message>
Any Pack(const Message& message) {
  Any packed;
  packed.set_type_url(TypeUrl<Message>());
  packed.set_value(message.SerializeAsString());
  return packed;
}

// Returns false if `packed` is another message.
template <typename Message>
bool Unpack(const Any& packed, Message& message) {
  return packed.type_url() == TypeUrl<Message>() && message.ParseFromString(packed.value());
}

v1::ErrorInfo InfoOf(const ErrorDetail& detail) {
  v1::ErrorInfo info;
  info.set_reason(detail.reason);
  info.set_domain(kDomain);
  if (!detail.limit.empty()) (*info.mutable_metadata())[kLimit] = detail.limit;
  if (!detail.value.empty()) (*info.mutable_metadata())[kValue] = detail.value;
  return info;
}

v1::RetryInfo RetryAfter(absl::Duration wait) {
  v1::RetryInfo retry;
  const int64_t nanos = absl::ToInt64Nanoseconds(wait);
  retry.mutable_retry_delay()->set_seconds(nanos / 1'000'000'000);
  retry.mutable_retry_delay()->set_nanos(static_cast<int32_t>(nanos % 1'000'000'000));
  return retry;
}

void AddInfo(const v1::ErrorInfo& info, ErrorDetail& detail) {
  const auto text = [&](const char* key) {
    const auto found = info.metadata().find(key);
    return found == info.metadata().end() ? std::string() : found->second;
  };
  detail.reason = info.reason();
  detail.limit = text(kLimit);
  detail.value = text(kValue);
}

void AddPacked(const Any& packed, ErrorDetail& detail) {
  v1::ErrorInfo info;
  v1::BadRequest bad;
  v1::ResourceInfo resource;
  v1::RetryInfo retry;
  if (Unpack(packed, info)) {
    AddInfo(info, detail);
  } else if (Unpack(packed, bad)) {
    if (bad.field_violations_size() > 0) detail.field = bad.field_violations(0).field();
  } else if (Unpack(packed, resource)) {
    detail.resource = resource.resource_name();
  } else if (Unpack(packed, retry)) {
    detail.retry_after = absl::Seconds(retry.retry_delay().seconds()) +
                         absl::Nanoseconds(retry.retry_delay().nanos());
  }
}

}  // namespace

absl::Status WithDetail(absl::Status status, const ErrorDetail& detail) {
  // The innermost caller knows most, so its detail stays when outer ones add theirs.
  if (status.ok() || status.GetPayload(TypeUrl<v1::ErrorInfo>()).has_value()) return status;
  for (const Any& packed : PackDetail(detail)) {
    status.SetPayload(packed.type_url(), absl::Cord(packed.value()));
  }
  return status;
}

ErrorDetail DetailOf(const absl::Status& status) {
  ErrorDetail detail;
  status.ForEachPayload([&](absl::string_view type_url, const absl::Cord& value) {
    Any packed;
    packed.set_type_url(std::string(type_url));
    packed.set_value(std::string(value));
    AddPacked(packed, detail);
  });
  return detail;
}

std::vector<Any> PackDetail(const ErrorDetail& detail, std::string_view description) {
  std::vector<Any> packed = {Pack(InfoOf(detail))};
  if (!detail.field.empty()) {
    v1::BadRequest bad;
    v1::BadRequest::FieldViolation& violation = *bad.add_field_violations();
    violation.set_field(detail.field);
    violation.set_description(std::string(description));
    packed.push_back(Pack(bad));
  }
  if (!detail.resource.empty()) {
    v1::ResourceInfo resource;
    resource.set_resource_type(ResourceTypeOf(detail.resource));
    resource.set_resource_name(detail.resource);
    packed.push_back(Pack(resource));
  }
  if (detail.retry_after) packed.push_back(Pack(RetryAfter(*detail.retry_after)));
  return packed;
}

ErrorDetail UnpackDetail(const google::protobuf::RepeatedPtrField<Any>& packed) {
  ErrorDetail detail;
  for (const Any& message : packed) AddPacked(message, detail);
  return detail;
}

std::string ResourceTypeOf(std::string_view name) {
  std::vector<std::string> parts = absl::StrSplit(std::string(name), '/');
  // Operators name a scene's project where its id alone is ambiguous.
  if (parts[0] == "projects" && parts.size() > 2) parts.erase(parts.begin(), parts.begin() + 2);
  static const std::map<std::string, std::string> kTop = {
      {"scenes", "Scene"}, {"jobs", "Job"}, {"keys", "ApiKey"}};
  static const std::map<std::string, std::string> kBelowScene = {{"uploads", "Upload"},
                                                                 {"datasets", "Dataset"},
                                                                 {"models", "Model"},
                                                                 {"labels", "Label"},
                                                                 {"selections", "Selection"}};
  const bool below = parts.size() == 4 && parts[0] == "scenes";
  if (!below && parts.size() != 2) return "file";
  const auto& kinds = below ? kBelowScene : kTop;
  const auto found = kinds.find(parts[below ? 2 : 0]);
  return found == kinds.end() ? "file" : absl::StrCat("pepeseg.v1.", found->second);
}

}  // namespace pepeseg
