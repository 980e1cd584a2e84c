#include "tests/server/call.h"

#include <gtest/gtest-spi.h>

#include "absl/time/time.h"
#include "server/api/error.h"
#include "tests/testing/eventually.h"

namespace pepeseg {
namespace {

TEST(ExpectError, ComparesTheCodeTheDetailsAndTheMessage) {
  const grpc::Status status = ToGrpc(BadField("prompt.x", "7", "too large"));
  EXPECT_ERROR(status, grpc::INVALID_ARGUMENT);
  EXPECT_ERROR(status, grpc::INVALID_ARGUMENT, "prompt.x", "too large");
  EXPECT_ERROR(status, grpc::INVALID_ARGUMENT, {.reason = "BAD_FIELD", .value = "7"});
  EXPECT_FALSE(IsError(grpc::Status::OK, grpc::INVALID_ARGUMENT));
  EXPECT_FALSE(IsError(status, grpc::NOT_FOUND));
  EXPECT_FALSE(IsError(status, grpc::INVALID_ARGUMENT, "prompt"));
  EXPECT_FALSE(IsError(status, grpc::INVALID_ARGUMENT, "prompt.x", "too small"));
  EXPECT_FALSE(IsError(status, grpc::INVALID_ARGUMENT, {.reason = "NO_MODEL"}));
  EXPECT_FALSE(IsError(status, grpc::INVALID_ARGUMENT, {.resource = "scenes/a"}));
  EXPECT_FALSE(IsError(status, grpc::INVALID_ARGUMENT, {.value = "8"}));
  EXPECT_FALSE(IsError(status, grpc::INVALID_ARGUMENT, {.limit = "9"}));
}

TEST(Reply, FailsTheTestWhenTheAnswerOfAFailedCallIsRead) {
  const auto read = [] {
    const Reply<v1::Scene> reply({grpc::NOT_FOUND, "no such scene"}, {},
                                 std::source_location::current());
    EXPECT_EQ(reply->name(), "");
  };
  EXPECT_NONFATAL_FAILURE(read(), "the call failed: no such scene");
}

TEST(Eventually, ReportsAConditionThatStaysFalse) {
  int num_calls = 0;
  EXPECT_TRUE(testing::Eventually([&] { return ++num_calls == 3; }));
  EXPECT_FALSE(testing::Eventually([] { return false; }, absl::Milliseconds(5)));
}

}  // namespace
}  // namespace pepeseg
