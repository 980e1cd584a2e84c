#pragma once

#include <google/protobuf/message.h>
#include <grpcpp/support/status.h>

#include <string>

#include "absl/strings/str_cat.h"
#include "clients/cpp/answer_status.h"
#include "pepeseg/v1/errors.pb.h"

namespace pepeseg::client {

// Adds a detail under the type URL that google.rpc's message of this name has.
inline void AddDetail(const google::protobuf::Message& message, v1::Status& trailer) {
  auto& detail = *trailer.add_details();
  detail.set_type_url(
      absl::StrCat("type.googleapis.com/google.rpc.", message.GetDescriptor()->name()));
  detail.set_value(message.SerializeAsString());
}

// Returns an error as a server sends it: proto/pepeseg/v1/errors.proto.
inline grpc::Status ServerError(grpc::StatusCode code, const std::string& message,
                                const ErrorDetail& detail) {
  v1::Status trailer;
  v1::ErrorInfo info;
  info.set_reason(detail.reason);
  info.set_domain("pepeseg");
  if (!detail.limit.empty()) (*info.mutable_metadata())["limit"] = detail.limit;
  if (!detail.value.empty()) (*info.mutable_metadata())["value"] = detail.value;
  AddDetail(info, trailer);
  v1::BadRequest request;
  request.add_field_violations()->set_field(detail.field);
  if (!detail.field.empty()) AddDetail(request, trailer);
  v1::ResourceInfo resource;
  resource.set_resource_name(detail.resource);
  if (!detail.resource.empty()) AddDetail(resource, trailer);
  v1::RetryInfo retry;
  if (detail.retry_after) {
    const absl::Duration wait = *detail.retry_after;
    retry.mutable_retry_delay()->set_seconds(absl::ToInt64Seconds(wait));
    retry.mutable_retry_delay()->set_nanos(static_cast<int32_t>(
        absl::ToInt64Nanoseconds(wait - absl::Seconds(absl::ToInt64Seconds(wait)))));
    AddDetail(retry, trailer);
  }
  return {code, message, trailer.SerializeAsString()};
}

}  // namespace pepeseg::client
