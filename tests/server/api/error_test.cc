#include "server/api/error.h"

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/dynamic_message.h>
#include <google/protobuf/text_format.h>
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "core/base/errors.h"
#include "core/query/prompt.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

v1::Error WireDetailOf(const grpc::Status& status) {
  v1::Status proto;
  EXPECT_TRUE(proto.ParseFromString(status.error_details()));
  EXPECT_EQ(proto.code(), status.error_code());
  EXPECT_EQ(proto.message(), status.error_message());
  return FlatError(proto);
}

// Status and details of the package google.rpc, as Google publishes them.
constexpr char kGoogleRpc[] = R"(
  name: "google/rpc/published.proto" package: "google.rpc" syntax: "proto3"
  dependency: "google/protobuf/any.proto" dependency: "google/protobuf/duration.proto"
  message_type { name: "Status"
    field { name: "code" number: 1 type: TYPE_INT32 label: LABEL_OPTIONAL }
    field { name: "message" number: 2 type: TYPE_STRING label: LABEL_OPTIONAL }
    field { name: "details" number: 3 type: TYPE_MESSAGE label: LABEL_REPEATED
            type_name: ".google.protobuf.Any" } }
  message_type { name: "ErrorInfo"
    field { name: "reason" number: 1 type: TYPE_STRING label: LABEL_OPTIONAL }
    field { name: "domain" number: 2 type: TYPE_STRING label: LABEL_OPTIONAL }
    field { name: "metadata" number: 3 type: TYPE_MESSAGE label: LABEL_REPEATED
            type_name: ".google.rpc.ErrorInfo.MetadataEntry" }
    nested_type { name: "MetadataEntry"
      field { name: "key" number: 1 type: TYPE_STRING label: LABEL_OPTIONAL }
      field { name: "value" number: 2 type: TYPE_STRING label: LABEL_OPTIONAL }
      options { map_entry: true } } }
  message_type { name: "BadRequest"
    field { name: "field_violations" number: 1 type: TYPE_MESSAGE label: LABEL_REPEATED
            type_name: ".google.rpc.BadRequest.FieldViolation" }
    nested_type { name: "FieldViolation"
      field { name: "field" number: 1 type: TYPE_STRING label: LABEL_OPTIONAL }
      field { name: "description" number: 2 type: TYPE_STRING label: LABEL_OPTIONAL } } }
  message_type { name: "ResourceInfo"
    field { name: "resource_type" number: 1 type: TYPE_STRING label: LABEL_OPTIONAL }
    field { name: "resource_name" number: 2 type: TYPE_STRING label: LABEL_OPTIONAL }
    field { name: "owner" number: 3 type: TYPE_STRING label: LABEL_OPTIONAL }
    field { name: "description" number: 4 type: TYPE_STRING label: LABEL_OPTIONAL } }
  message_type { name: "RetryInfo"
    field { name: "retry_delay" number: 1 type: TYPE_MESSAGE label: LABEL_OPTIONAL
            type_name: ".google.protobuf.Duration" } }
)";

// Decodes a status as a tool does that knows the types of google.rpc and none of ours. Returns the
// details as text, one a line.
std::vector<std::string> DecodeAsGoogleRpc(const grpc::Status& status) {
  using google::protobuf::Descriptor;
  google::protobuf::DescriptorPool pool(google::protobuf::DescriptorPool::generated_pool());
  google::protobuf::FileDescriptorProto published;
  EXPECT_TRUE(google::protobuf::TextFormat::ParseFromString(kGoogleRpc, &published));
  EXPECT_NE(pool.BuildFile(published), nullptr);
  google::protobuf::DynamicMessageFactory factory(&pool);
  const auto decode = [&](const std::string& type, const std::string& bytes) {
    const Descriptor* descriptor = pool.FindMessageTypeByName(type);
    if (descriptor == nullptr) return "unknown type " + type;
    const std::unique_ptr<google::protobuf::Message> message(
        factory.GetPrototype(descriptor)->New());
    EXPECT_TRUE(message->ParseFromString(bytes)) << type;
    EXPECT_TRUE(message->GetReflection()->GetUnknownFields(*message).empty()) << type;
    return descriptor->name() + " { " + message->ShortDebugString() + " }";
  };
  v1::Status envelope;
  EXPECT_TRUE(envelope.ParseFromString(status.error_details()));
  EXPECT_NE(decode("google.rpc.Status", status.error_details()), "");
  std::vector<std::string> decoded;
  for (const auto& detail : envelope.details()) {
    const std::string& url = detail.type_url();
    decoded.push_back(decode(url.substr(url.rfind('/') + 1), detail.value()));
  }
  return decoded;
}

TEST(ToGrpc, ReturnsOkForOk) {
  EXPECT_TRUE(ToGrpc(absl::OkStatus()).ok());
  EXPECT_TRUE(ToGrpc(absl::OkStatus()).error_details().empty());
}

TEST(ToGrpc, KeepsCodeAndMessage) {
  const grpc::Status status = ToGrpc(absl::DataLossError("gaussians.ply: 3 bytes are missing"));
  EXPECT_EQ(status.error_code(), grpc::DATA_LOSS);
  EXPECT_EQ(status.error_message(), "gaussians.ply: 3 bytes are missing");
  EXPECT_EQ(WireDetailOf(status).reason(), "DATA_LOSS");
  EXPECT_THAT(DecodeAsGoogleRpc(status),
              ElementsAre("ErrorInfo { reason: \"DATA_LOSS\" domain: \"pepeseg\" }"));
}

TEST(ToGrpc, AddsAReasonForPromptsOnNothing) {
  const grpc::Status status = ToGrpc(NothingThereError("point 0: nothing is there"));
  EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(WireDetailOf(status).reason(), "NOTHING_THERE");
}

TEST(ToGrpc, KeepsTheFirstDetail) {
  const absl::Status bad = BadField("files[3].path", "../x", "has the part '..'");
  EXPECT_EQ(bad.message(), "files[3].path: '../x': has the part '..'");
  const v1::Error detail = WireDetailOf(ToGrpc(WithResource(bad, "OTHER", "jobs/j1")));
  EXPECT_EQ(detail.reason(), "BAD_FIELD");
  EXPECT_EQ(detail.field(), "files[3].path");
  EXPECT_EQ(detail.value(), "../x");
  EXPECT_EQ(detail.resource(), "");
}

TEST(ToGrpc, SendsDetailsOfGoogleRpc) {
  const absl::Status error = WithDetail(absl::AbortedError("scenes/cup: jobs/j7 is running"),
                                        {.reason = "JOB_ACTIVE",
                                         .field = "scene",
                                         .resource = "jobs/j7",
                                         .limit = "1 job",
                                         .retry_after = absl::Milliseconds(1500)});
  EXPECT_THAT(
      DecodeAsGoogleRpc(ToGrpc(error)),
      ElementsAre("ErrorInfo { reason: \"JOB_ACTIVE\" domain: \"pepeseg\" metadata { key: "
                  "\"limit\" value: \"1 job\" } }",
                  "BadRequest { field_violations { field: \"scene\" description: \"scenes/cup: "
                  "jobs/j7 is running\" } }",
                  "ResourceInfo { resource_type: \"pepeseg.v1.Job\" resource_name: \"jobs/j7\" }",
                  "RetryInfo { retry_delay { seconds: 1 nanos: 500000000 } }"));
}

TEST(CheckAnswerSize, RefusesWhatIsOver4MiB) {
  EXPECT_TRUE(CheckAnswerSize(4 << 20).ok());
  const v1::Status error = ToProto(CheckAnswerSize((4 << 20) + 1));
  EXPECT_EQ(error.code(), grpc::RESOURCE_EXHAUSTED);
  EXPECT_EQ(FlatError(error).reason(), "ANSWER_TOO_LARGE");
}

TEST(FlatError, HasTheSameInFields) {
  const absl::Status bad = BadField("files[3].path", "../x", "has the part '..'");
  const v1::Error error = FlatError(ToProto(bad));
  EXPECT_EQ(error.code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(error.message(), bad.message());
  EXPECT_EQ(error.reason(), "BAD_FIELD");
  EXPECT_EQ(error.field(), "files[3].path");
  EXPECT_EQ(error.value(), "../x");
  EXPECT_EQ(error.limit(), "has the part '..'");
  EXPECT_EQ(error.resource(), "");
  EXPECT_FALSE(error.has_retry_after());
  EXPECT_EQ(FlatError(ToProto(BusyError())).retry_after().seconds(), 1);
}

TEST(ToGrpc, SaysWhenToRetry) {
  const v1::Error detail = WireDetailOf(ToGrpc(DrainingError()));
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
  const ErrorDetail everything = {.reason = "UNAUTHENTICATED_AND_MUCH_MORE",
                                  .field = umlauts,
                                  .resource = umlauts,
                                  .limit = umlauts,
                                  .value = umlauts,
                                  .retry_after = absl::Milliseconds(123'456'789)};
  EXPECT_LT(BytesInTrailers(ToGrpc(WithDetail(absl::InternalError(umlauts), everything))), 4096u);
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
