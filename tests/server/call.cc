#include "tests/server/call.h"

#include "absl/strings/str_cat.h"
#include "server/api/error.h"

namespace pepeseg {

v1::Error DetailOf(const grpc::Status& status) {
  v1::Status proto;
  EXPECT_TRUE(proto.ParseFromString(status.error_details()));
  EXPECT_GE(proto.details_size(), 1) << status.error_message();
  for (const auto& detail : proto.details()) {
    EXPECT_TRUE(detail.type_url().starts_with("type.googleapis.com/google.rpc."))
        << detail.type_url();
  }
  return FlatError(proto);
}

::testing::AssertionResult IsError(const grpc::Status& status, grpc::StatusCode code,
                                   const ErrorParts& parts) {
  std::string differences;
  const auto compare = [&](const std::string& name, const std::string& got,
                           const std::string& want) {
    if (!want.empty() && got != want) {
      absl::StrAppend(&differences, "\n  ", name, " is \"", got, "\", not \"", want, "\"");
    }
  };
  if (status.error_code() != code) {
    absl::StrAppend(&differences, "\n  the code is ", status.error_code(), ", not ", code);
  } else if (!absl::StrCat(parts.field, parts.reason, parts.resource, parts.value, parts.limit)
                  .empty()) {
    const v1::Error detail = DetailOf(status);
    compare("field", detail.field(), parts.field);
    compare("reason", detail.reason(), parts.reason);
    compare("resource", detail.resource(), parts.resource);
    compare("value", detail.value(), parts.value);
    compare("limit", detail.limit(), parts.limit);
  }
  if (status.error_message().find(parts.message) == std::string::npos) {
    absl::StrAppend(&differences, "\n  the message does not have \"", parts.message, "\"");
  }
  if (differences.empty()) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << "\"" << status.error_message() << "\":" << differences;
}

}  // namespace pepeseg
