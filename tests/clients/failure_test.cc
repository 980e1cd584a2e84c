#include "clients/terminal/failure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "clients/cpp/file_bytes.h"
#include "clients/cpp/proxy.h"
#include "tests/clients/cpp/server_error.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg::client::cli {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

grpc::Status WithDetail() {
  ErrorDetail detail;
  detail.reason = "JOB_ACTIVE";
  detail.resource = "jobs/17";
  detail.limit = "one training a scene";
  return ServerError(grpc::ABORTED, "a training is running", detail);
}

grpc::Status Refused(const std::string& reason) {
  const bool is_key = reason.find("KEY") != std::string::npos;
  ErrorDetail detail;
  detail.reason = reason;
  return ServerError(is_key ? grpc::UNAUTHENTICATED : grpc::PERMISSION_DENIED, "refused", detail);
}

TEST(Explain, GivesTheRemedyForARefusedKey) {
  const auto explain = [](const char* reason) {
    return Explain(FromGrpc(Refused(reason)), "host:1");
  };
  EXPECT_THAT(explain("NO_KEY"), AllOf(HasSubstr("--key-file"), HasSubstr("PEPESEG_KEY")));
  EXPECT_THAT(explain("BAD_KEY"), HasSubstr("another one"));
  EXPECT_THAT(explain("MISSING_SCOPE"), HasSubstr("a key, or a token, that has it"));
  EXPECT_THAT(explain("NOT_YOURS"), HasSubstr("pepeseg scenes"));
  EXPECT_EQ(ExitCodeOf(FromGrpc(Refused("NO_KEY"))), 10);
}

TEST(Explain, BlamesTheProxyAndNotTheServer) {
  const std::string refused = client::ExplainProxyFailure(
      {"10.0.0.1:3128", "http_proxy"}, "host:1",
      "failed to connect to all addresses; last error: UNKNOWN: ipv4:10.0.0.1:3128: HTTP proxy "
      "returned response code 403");
  const absl::Status status = FromGrpc({grpc::UNAVAILABLE, refused});
  EXPECT_EQ(Explain(status, "host:1"), "pepeseg: " + refused);
  EXPECT_EQ(ExitCodeOf(status), 5);
}

TEST(Explain, DistinguishesGatewayFromServer) {
  const auto explain = [](grpc::StatusCode code, const char* message) {
    return Explain(FromGrpc({code, message}), "host:1");
  };
  EXPECT_THAT(explain(grpc::UNAUTHENTICATED, "the token has expired"),
              AllOf(HasSubstr("the token has expired"), HasSubstr("gateway"),
                    HasSubstr("--key-file"), HasSubstr("PEPESEG_KEY")));
  EXPECT_THAT(explain(grpc::PERMISSION_DENIED, "the token names no project"), HasSubstr("gateway"));
  EXPECT_THAT(explain(grpc::RESOURCE_EXHAUSTED, "more than 100 calls in 10s"), HasSubstr("wait"));
  EXPECT_THAT(explain(grpc::UNAVAILABLE, "no server answers the gateway: ask again"),
              AllOf(HasSubstr("try again"), Not(HasSubstr("pepesegd"))));
  EXPECT_THAT(explain(grpc::UNAVAILABLE, "failed to connect to all addresses"),
              AllOf(HasSubstr("host:1"), HasSubstr("--server"), Not(HasSubstr("pepesegd"))))
      << "a command on this machine cannot start a server there";
}

TEST(FromGrpc, ExplainsHttpAnswersOfProxies) {
  const auto answered = [](int http) {
    return FromGrpc(
        {grpc::StatusCode::UNKNOWN, "Received http2 header with status: " + std::to_string(http)});
  };
  for (const auto& [http, exit_code] : {std::pair(401, 10),
                                        {403, 10},
                                        {404, 5},
                                        {407, 10},
                                        {413, 9},
                                        {429, 9},
                                        {431, 9},
                                        {502, 5},
                                        {503, 5},
                                        {504, 5},
                                        {301, 5},
                                        {500, 5},
                                        {418, 5}}) {
    EXPECT_EQ(ExitCodeOf(answered(http)), exit_code) << http;
    EXPECT_THAT(Explain(answered(http), "host:1"),
                AllOf(HasSubstr("HTTP " + std::to_string(http)), HasSubstr("proxy"),
                      Not(HasSubstr("http2"))));
  }
  const absl::Status page = FromGrpc({grpc::StatusCode::UNKNOWN, "Stream removed"});
  EXPECT_EQ(ExitCodeOf(page), 5);
  EXPECT_THAT(Explain(page, "host:1"), HasSubstr("proxy"));
  const absl::Status http1 =
      FromGrpc({grpc::StatusCode::UNAVAILABLE, "Trying to connect an http1.x server"});
  EXPECT_EQ(ExitCodeOf(http1), 5);
  EXPECT_THAT(std::string(http1.message()), HasSubstr("not a pepeseg server"));
}

TEST(ExitCodeOf, DependsOnTheKindOfFailure) {
  EXPECT_EQ(ExitCodeOf(absl::OkStatus()), 0);
  EXPECT_EQ(ExitCodeOf(absl::InternalError("")), 1);
  EXPECT_EQ(ExitCodeOf(absl::NotFoundError("")), 3);
  EXPECT_EQ(ExitCodeOf(absl::InvalidArgumentError("")), 4);
  EXPECT_EQ(ExitCodeOf(absl::UnavailableError("")), 5);
  EXPECT_EQ(ExitCodeOf(absl::AlreadyExistsError("")), 6);
  EXPECT_EQ(ExitCodeOf(JobFailed("x")), 7);
  EXPECT_EQ(ExitCodeOf(JobCancelled("x")), 8);
  EXPECT_EQ(ExitCodeOf(absl::ResourceExhaustedError("")), 9);
  EXPECT_EQ(ExitCodeOf(absl::PermissionDeniedError("")), 10);
  EXPECT_EQ(ExitCodeOf(absl::DataLossError("")), 11);
}

TEST(Explain, DoesNotBlameTheServerForLocalFiles) {
  const absl::Status missing = LocalFileError("read", "cup.png", ENOENT);
  EXPECT_EQ(ExitCodeOf(missing), 3);
  EXPECT_EQ(Explain(missing, "host:1"), "pepeseg: cannot read cup.png: No such file or directory");
  for (const int error_number : {EACCES, EISDIR, ENOSPC, EROFS, EIO}) {
    const absl::Status refused = LocalFileError("write", "nodir/x.ply", error_number);
    EXPECT_EQ(ExitCodeOf(refused), 4) << refused;
    EXPECT_THAT(Explain(refused, "host:1"), AllOf(HasSubstr("cannot write nodir/x.ply: "),
                                                  Not(HasSubstr("gateway")), Not(HasSubstr("\n"))));
  }
}

TEST(Explain, GivesTheRemedy) {
  const std::string text = Explain(FromGrpc(WithDetail()), "host:1");
  EXPECT_THAT(text, HasSubstr("a training is running"));
  EXPECT_THAT(text, HasSubstr("one training a scene"));
  EXPECT_THAT(text, HasSubstr("pepeseg watch jobs/17"));
  EXPECT_THAT(Explain(absl::UnavailableError("refused"), "host:1"), HasSubstr("host:1"));
}

TEST(Explain, DoesNotDoubtThatABusyServerIsRunning) {
  ErrorDetail detail;
  detail.reason = "BUSY";
  detail.retry_after = absl::Seconds(3);
  const grpc::Status busy = ServerError(grpc::UNAVAILABLE, "too many calls are waiting", detail);
  EXPECT_THAT(Explain(FromGrpc(busy), "127.0.0.1:1"),
              AllOf(HasSubstr("try again in 3 s"), Not(HasSubstr("listening"))));
}

TEST(StartCommand, NamesAProgramThatExists) {
  const pepeseg::testing::TempFolder folder;
  const std::string program = (folder / "pepesegd").string();
  const std::string path = std::getenv("PATH");
  setenv("PATH", "/nowhere", 1);
  EXPECT_EQ(StartCommand("127.0.0.1:50051", folder.path()), "");
  std::ofstream(program) << "#!/bin/sh\n";
  EXPECT_EQ(StartCommand("127.0.0.1:50051", folder.path()), "") << "not executable yet";
  std::filesystem::permissions(program, std::filesystem::perms::owner_all);
  EXPECT_EQ(StartCommand("127.0.0.1:50051", folder.path()), program);
  EXPECT_EQ(StartCommand("localhost:6000", folder.path()), program + " --listen localhost:6000");
  setenv("PATH", folder.path().c_str(), 1);
  EXPECT_EQ(StartCommand("127.0.0.1:50051", "/nowhere"), "pepesegd");
  setenv("PATH", path.c_str(), 1);
  std::filesystem::create_directory(folder / "a b");
  std::filesystem::copy(program, folder / "a b" / "pepesegd");
  EXPECT_EQ(StartCommand("127.0.0.1:50051", folder / "a b"),
            "'" + (folder / "a b" / "pepesegd").string() + "'");
}

TEST(Explain, AdvisesTrainingOnlyIfNothingElseIsMissing) {
  EXPECT_THAT(Explain(absl::FailedPreconditionError("no model yet"), "host:1"),
              HasSubstr("pepeseg train"));
  ErrorDetail detail;
  detail.reason = "NO_BASE";
  detail.resource = "scenes/shelf/selections/1";
  const grpc::Status refused =
      ServerError(grpc::FAILED_PRECONDITION, "not made from another", detail);
  EXPECT_THAT(Explain(FromGrpc(refused), "host:1"),
              AllOf(HasSubstr("not made from another"), Not(HasSubstr("pepeseg train"))));
}

TEST(ExplainJson, HasTheErrorDetailsOfTheServer) {
  const auto json = nlohmann::json::parse(ExplainJson(FromGrpc(WithDetail())));
  EXPECT_EQ(json["error"]["code"], "ABORTED");
  EXPECT_EQ(json["error"]["exit_code"], 6);
  EXPECT_EQ(json["error"]["reason"], "JOB_ACTIVE");
  EXPECT_EQ(json["error"]["resource"], "jobs/17");
}

TEST(ExplainJson, ReplacesBytesThatAreNotText) {
  const auto json = nlohmann::json::parse(ExplainJson(absl::InternalError("bad \xff byte")));
  EXPECT_EQ(json["error"]["exit_code"], 1);
}

}  // namespace
}  // namespace pepeseg::client::cli
