#include "clients/cpp/answer_status.h"

#include <gtest/gtest.h>

#include "tests/clients/cpp/server_error.h"

namespace pepeseg::client {
namespace {

TEST(DetailOf, HasAllDetailsOfTheServer) {
  const absl::Status status = FromGrpc(ServerError(
      grpc::UNAVAILABLE, "busy",
      {"BUSY", "prompt.view", "jobs/17", "8 bytes", "9 bytes", absl::Milliseconds(1500)}));
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(status.message(), "busy");
  const auto detail = DetailOf(status);
  ASSERT_TRUE(detail.has_value());
  EXPECT_EQ(detail->reason, "BUSY");
  EXPECT_EQ(detail->field, "prompt.view");
  EXPECT_EQ(detail->resource, "jobs/17");
  EXPECT_EQ(detail->limit, "8 bytes");
  EXPECT_EQ(detail->value, "9 bytes");
  EXPECT_EQ(detail->retry_after, absl::Milliseconds(1500));
}

TEST(DetailOf, LeavesEmptyWhatWasNotSent) {
  ErrorDetail sent;
  sent.reason = "NOT_FOUND";
  const auto detail = DetailOf(FromGrpc(ServerError(grpc::NOT_FOUND, "gone", sent)));
  ASSERT_TRUE(detail.has_value());
  EXPECT_EQ(detail->reason, "NOT_FOUND");
  EXPECT_EQ(detail->field + detail->resource + detail->limit + detail->value, "");
  EXPECT_FALSE(detail->retry_after.has_value());
}

TEST(DetailOf, IsEmptyForErrorsOfOtherServers) {
  EXPECT_FALSE(DetailOf(FromGrpc({grpc::UNAVAILABLE, "no connection"})).has_value());
  EXPECT_FALSE(DetailOf(FromGrpc({grpc::UNAVAILABLE, "x", "not a message"})).has_value());
  v1::ErrorInfo info;
  info.set_reason("RATE_LIMITED");
  info.set_domain("proxy.example");
  v1::Status trailer;
  AddDetail(info, trailer);
  EXPECT_FALSE(
      DetailOf(FromGrpc({grpc::UNAVAILABLE, "x", trailer.SerializeAsString()})).has_value());
}

}  // namespace
}  // namespace pepeseg::client
