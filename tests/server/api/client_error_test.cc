#include "server/api/client_error.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/private_error.h"
#include "server/api/error.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

const ClientErrorRules kRules = {"/srv/pepeseg", "request-7"};

v1::Error SentDetail(const grpc::Status& status) {
  v1::Status proto;
  EXPECT_TRUE(proto.ParseFromString(status.error_details()));
  EXPECT_FALSE(IsMarkedPrivate(proto)) << "no mark leaves the server";
  EXPECT_EQ(proto.message(), status.error_message());
  return FlatError(proto);
}

grpc::Status Sent(const absl::Status& status, bool changed = true) {
  grpc::Status sent = ToGrpc(status);
  EXPECT_EQ(HidePrivateText(kRules, sent), changed) << status;
  return sent;
}

TEST(HidePrivateText, NamesTheRequestInsteadOfAFault) {
  const grpc::Status sent = Sent(absl::InternalError("no such table: scenes"));
  EXPECT_EQ(sent.error_code(), grpc::INTERNAL);
  EXPECT_THAT(sent.error_message(), HasSubstr("request-7"));
  EXPECT_THAT(sent.error_message(), Not(HasSubstr("table")));
  EXPECT_EQ(SentDetail(sent).reason(), "INTERNAL");
  EXPECT_EQ(Sent(absl::UnknownError("std::bad_alloc")).error_code(), grpc::INTERNAL);
  grpc::Status own_of_grpc(grpc::UNKNOWN, "Unexpected error in RPC handling");
  EXPECT_TRUE(HidePrivateText(kRules, own_of_grpc));
  EXPECT_THAT(own_of_grpc.error_message(), HasSubstr("request-7"));
}

TEST(HidePrivateText, KeepsTheCodeOfPrivateErrors) {
  using absl::StatusCode;
  for (const StatusCode code : {StatusCode::kUnavailable, StatusCode::kDataLoss,
                                StatusCode::kAborted, StatusCode::kNotFound}) {
    const absl::Status error = PrivateError(code, "could not connect to server: db.lab.example");
    const grpc::Status sent = Sent(WithResource(error, "NO_SUCH_JOB", "jobs/j1"));
    EXPECT_EQ(sent.error_code(), static_cast<grpc::StatusCode>(code));
    EXPECT_THAT(sent.error_message(), Not(HasSubstr("db.lab.example")));
    EXPECT_NE(SentDetail(sent).reason(), "NO_SUCH_JOB") << "nobody knows whether there is none";
    EXPECT_EQ(SentDetail(sent).has_retry_after(), code == StatusCode::kUnavailable);
  }
}

TEST(HidePrivateText, SaysThatTheDiskIsFull) {
  const ErrorDetail detail = {.reason = kDiskFull, .resource = "images/1.jpg"};
  const absl::Status full =
      PrivateError(absl::StatusCode::kResourceExhausted, "/srv/pepeseg/partial: no space left");
  const grpc::Status sent = Sent(WithDetail(WithPrefix("images/1.jpg: ", full), detail));
  EXPECT_EQ(sent.error_code(), grpc::RESOURCE_EXHAUSTED);
  EXPECT_THAT(sent.error_message(), HasSubstr("disk is full"));
  EXPECT_EQ(SentDetail(sent).reason(), kDiskFull);
  EXPECT_EQ(SentDetail(sent).resource(), "images/1.jpg");
}

TEST(HidePrivateText, MakesPathsRelativeToTheDataDirectory) {
  const auto text = [](const char* message) {
    return Sent(absl::DataLossError(message)).error_message();
  };
  EXPECT_EQ(text("/srv/pepeseg/jobs/j1/gaussians.ply: wrong checksum"),
            "jobs/j1/gaussians.ply: wrong checksum");
  EXPECT_EQ(text("'/srv/pepeseg/a' and (/srv/pepeseg/b)"), "'a' and (b)");
  EXPECT_EQ(text("/srv/pepeseg: not readable"), "the data directory: not readable");
  EXPECT_EQ(text("/srv/pepeseg/: not readable"), "the data directory/: not readable");
}

TEST(HidePrivateText, HidesNothingLessInTheDetails) {
  // What is private must not stay in a value, or in the description of a field.
  const absl::Status error = PrivateError(absl::StatusCode::kUnavailable, "db.lab.example is away");
  grpc::Status sent = Sent(WithDetail(
      error,
      {.reason = "X", .field = "name", .limit = "db.lab.example", .value = "db.lab.example"}));
  EXPECT_THAT(sent.error_details(), Not(HasSubstr("db.lab.example")));
  EXPECT_EQ(SentDetail(sent).field(), "name") << "it came from the request";
  sent = Sent(WithDetail(absl::InvalidArgumentError("/srv/pepeseg/jobs/j1: is bad"),
                         {.reason = "X", .field = "name", .resource = "/srv/pepeseg/jobs/j1"}));
  EXPECT_THAT(sent.error_details(), Not(HasSubstr("/srv/pepeseg")));
  EXPECT_EQ(SentDetail(sent).resource(), "jobs/j1");
}

TEST(HidePrivateText, KeepsTextForClients) {
  const absl::Status bad = BadField("files[0].path", "images/srv/pepeseg/x", "is too long");
  EXPECT_EQ(Sent(bad, /*changed=*/false).error_message(), bad.message());
  EXPECT_EQ(SentDetail(Sent(bad, false)).value(), "images/srv/pepeseg/x");
  const absl::Status other = absl::NotFoundError("/srv/pepeseg2/x does not exist");
  EXPECT_EQ(Sent(other, false).error_message(), other.message());
  EXPECT_EQ(SentDetail(Sent(DrainingError(), false)).reason(), "DRAINING");
  EXPECT_TRUE(Sent(absl::OkStatus(), false).ok());
}

TEST(PrivateError, StaysPrivateWithAPrefix) {
  const absl::Status error = PrivateError(absl::StatusCode::kUnavailable, "database: busy");
  EXPECT_TRUE(IsPrivate(WithPrefix("jobs/j1: ", error)));
  EXPECT_EQ(WithPrefix("jobs/j1: ", error).message(), "jobs/j1: database: busy");
  EXPECT_FALSE(IsPrivate(absl::UnavailableError("database: busy")));
}

}  // namespace
}  // namespace pepeseg
