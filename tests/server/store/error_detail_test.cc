#include "server/store/error_detail.h"

#include <gtest/gtest.h>

#include "core/base/errors.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

const ErrorDetail kDetail = {.reason = "JOB_ACTIVE",
                             .field = "scene",
                             .resource = "jobs/j7",
                             .limit = "1 job",
                             .value = "2",
                             .retry_after = absl::Milliseconds(2500)};

TEST(ErrorDetail, TravelsOnAStatus) {
  const absl::Status status = WithDetail(absl::AbortedError("busy"), kDetail);
  EXPECT_EQ(status.message(), "busy");
  EXPECT_EQ(DetailOf(status), kDetail);
  EXPECT_EQ(DetailOf(WithPrefix("scenes/cup: ", status)), kDetail);
  EXPECT_EQ(DetailOf(WithDetail(absl::AbortedError(""), {.reason = "OTHER"})),
            ErrorDetail{.reason = "OTHER"});
}

TEST(ErrorDetail, OfTheInnermostCallerStays) {
  const absl::Status status = WithDetail(absl::AbortedError("busy"), {.reason = "INNER"});
  EXPECT_EQ(DetailOf(WithDetail(status, kDetail)), ErrorDetail{.reason = "INNER"});
}

TEST(ErrorDetail, IsAbsentFromOtherStatuses) {
  EXPECT_EQ(DetailOf(absl::AbortedError("busy")), ErrorDetail{});
  EXPECT_OK(WithDetail(absl::OkStatus(), kDetail));
  EXPECT_EQ(DetailOf(absl::OkStatus()), ErrorDetail{});
}

TEST(ErrorDetail, SkipsMessagesThatItDoesNotKnow) {
  google::protobuf::RepeatedPtrField<google::protobuf::Any> packed;
  packed.Add()->set_type_url("type.googleapis.com/google.rpc.Help");
  packed.Add()->set_type_url("pepeseg.server/private");
  for (const auto& message : PackDetail(kDetail, "in use")) *packed.Add() = message;
  EXPECT_EQ(UnpackDetail(packed), kDetail);
}

TEST(ResourceType, IsThatOfTheName) {
  EXPECT_EQ(ResourceTypeOf("scenes/cup"), "pepeseg.v1.Scene");
  EXPECT_EQ(ResourceTypeOf("projects/lab/scenes/cup"), "pepeseg.v1.Scene");
  EXPECT_EQ(ResourceTypeOf("scenes/cup/uploads/1"), "pepeseg.v1.Upload");
  EXPECT_EQ(ResourceTypeOf("scenes/cup/datasets/1"), "pepeseg.v1.Dataset");
  EXPECT_EQ(ResourceTypeOf("scenes/cup/models/live"), "pepeseg.v1.Model");
  EXPECT_EQ(ResourceTypeOf("projects/lab/scenes/cup/models/1"), "pepeseg.v1.Model");
  EXPECT_EQ(ResourceTypeOf("scenes/cup/labels/red"), "pepeseg.v1.Label");
  EXPECT_EQ(ResourceTypeOf("scenes/cup/selections/3"), "pepeseg.v1.Selection");
  EXPECT_EQ(ResourceTypeOf("jobs/j7"), "pepeseg.v1.Job");
  EXPECT_EQ(ResourceTypeOf("keys/0123456789abcdef"), "pepeseg.v1.ApiKey");
  for (const char* path : {"images/1.jpg", "1.jpg", "", "scenes/cup/jobs/j7", "jobs/j7/x"}) {
    EXPECT_EQ(ResourceTypeOf(path), "file") << path;
  }
}

}  // namespace
}  // namespace pepeseg
