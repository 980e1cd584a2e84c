#include "server/api/error.h"

#include <gtest/gtest.h>

#include "core/query/check_prompt.h"

namespace pepeseg {
namespace {

v1::ErrorDetail DetailOf(const grpc::Status& status) {
  v1::Status proto;
  EXPECT_TRUE(proto.ParseFromString(status.error_details()));
  EXPECT_EQ(proto.code(), status.error_code());
  EXPECT_EQ(proto.message(), status.error_message());
  v1::ErrorDetail detail;
  EXPECT_EQ(proto.details_size(), 1);
  if (proto.details_size() == 1) {
    EXPECT_TRUE(proto.details(0).UnpackTo(&detail));
  }
  return detail;
}

TEST(ToGrpc, ReturnsOkForOk) {
  EXPECT_TRUE(ToGrpc(absl::OkStatus()).ok());
  EXPECT_TRUE(ToGrpc(absl::OkStatus()).error_details().empty());
}

TEST(ToGrpc, KeepsCodeAndMessage) {
  const grpc::Status status = ToGrpc(absl::DataLossError("gaussians.ply: 3 bytes are missing"));
  EXPECT_EQ(status.error_code(), grpc::DATA_LOSS);
  EXPECT_EQ(status.error_message(), "gaussians.ply: 3 bytes are missing");
  EXPECT_EQ(DetailOf(status).reason(), "DATA_LOSS");
}

TEST(ToGrpc, AddsAReasonForPromptsOnNothing) {
  const grpc::Status status = ToGrpc(NothingThereError("point 0: nothing is there"));
  EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(DetailOf(status).reason(), "NOTHING_THERE");
}

TEST(ToGrpc, KeepsTheFirstDetail) {
  const absl::Status bad = BadField("files[3].path", "../x", "has the part '..'");
  EXPECT_EQ(bad.message(), "files[3].path: '../x': has the part '..'");
  const v1::ErrorDetail detail = DetailOf(ToGrpc(WithResource(bad, "OTHER", "jobs/j1")));
  EXPECT_EQ(detail.reason(), "BAD_FIELD");
  EXPECT_EQ(detail.field(), "files[3].path");
  EXPECT_EQ(detail.value(), "../x");
  EXPECT_EQ(detail.resource(), "");
}

TEST(ToGrpc, SaysWhenToRetry) {
  const v1::ErrorDetail detail = DetailOf(ToGrpc(DrainingError()));
  EXPECT_EQ(detail.reason(), "DRAINING");
  EXPECT_GT(detail.retry_after().seconds(), 0);
}

// Percent-encoding makes one byte three, base64 makes three bytes four.
size_t BytesInTrailers(const grpc::Status& status) {
  return 3 * status.error_message().size() + (status.error_details().size() + 2) / 3 * 4;
}

TEST(ToGrpc, StaysUnder4Kilobytes) {
  std::string umlauts;
  while (umlauts.size() < 100'000) umlauts += "\xc3\xa4";
  EXPECT_LT(BytesInTrailers(ToGrpc(absl::InternalError(umlauts))), 4096u);
  EXPECT_LT(BytesInTrailers(ToGrpc(BadField(umlauts, umlauts, umlauts))), 4096u);
}

TEST(Utf8Prefix, ReplacesInvalidUtf8AndCutsBetweenCharacters) {
  EXPECT_EQ(Utf8Prefix("plain", 100), "plain");
  EXPECT_EQ(Utf8Prefix("plain", 3), "pla");
  EXPECT_EQ(Utf8Prefix("\xc3\xa4\xc3\xa4", 3), "\xc3\xa4");
  EXPECT_EQ(Utf8Prefix("\xe2\x82\xac \xf0\x9f\x98\x80", 100), "\xe2\x82\xac \xf0\x9f\x98\x80");
  EXPECT_EQ(Utf8Prefix("a\xff\x80z", 100), "a??z");
  EXPECT_EQ(Utf8Prefix("\xc0\xaf", 100), "??") << "an overlong slash";
  EXPECT_EQ(Utf8Prefix("\xed\xa0\x80", 100), "???") << "a surrogate";
  EXPECT_EQ(Utf8Prefix("\xf4\x90\x80\x80", 100), "????") << "beyond U+10FFFF";
  EXPECT_EQ(Utf8Prefix("end\xe2\x82", 100), "end??") << "cut short";
}

}  // namespace
}  // namespace pepeseg
