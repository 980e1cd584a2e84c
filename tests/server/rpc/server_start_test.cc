// What keeps a server from starting.
#include <gtest/gtest.h>

#include <fstream>

#include "tests/server/rpc/running_server.h"

namespace pepeseg {
namespace {

ServerOptions OptionsIn(const testing::TempFolder& folder) {
  ServerOptions options;
  options.data = folder.path();
  options.worker = PEPESEG_FAKE_WORKER;
  return options;
}

TEST(ServerStart, RefusesOtherMachinesUnlessToldTo) {
  const testing::TempFolder folder;
  ServerOptions options = OptionsIn(folder);
  options.listen = "0.0.0.0:0";
  const auto refused = Server::Start(options);
  EXPECT_TRUE(absl::IsFailedPrecondition(refused.status())) << refused.status();
  EXPECT_NE(refused.status().message().find("--insecure"), std::string::npos);
  options.insecure = true;
  EXPECT_TRUE(Server::Start(options).ok());
}

TEST(ServerStart, RefusesAMissingWorkerAndATakenDataDirectory) {
  const testing::TempFolder folder;
  ServerOptions options;
  options.data = folder.path();
  options.worker = "/no/such/program";
  EXPECT_TRUE(absl::IsFailedPrecondition(Server::Start(options).status()));
  options.worker = PEPESEG_FAKE_WORKER;
  auto first = Server::Start(options);
  ASSERT_TRUE(first.ok()) << first.status();
  const auto second = Server::Start(options);
  EXPECT_TRUE(absl::IsFailedPrecondition(second.status())) << second.status();
  EXPECT_NE(second.status().message().find("another server"), std::string::npos);
  first->reset();
  EXPECT_TRUE(Server::Start(options).ok());
}

TEST(ServerStart, RefusesADeviceThatCannotBeHad) {
  const testing::TempFolder folder;
  ServerOptions options = OptionsIn(folder);
  options.device = "cuda:1000";
  const auto refused = Server::Start(options);
  EXPECT_TRUE(absl::IsFailedPrecondition(refused.status())) << refused.status();
  EXPECT_NE(refused.status().message().find("device cuda:1000: "), std::string::npos);
}

TEST(ServerStart, RefusesWeightsThatAreNone) {
  const testing::TempFolder folder;
  ServerOptions options = OptionsIn(folder);
  options.lpips_weights = folder / "lpips.onnx";
  EXPECT_EQ(Server::Start(options).status().code(), absl::StatusCode::kNotFound);
  std::ofstream(folder / "lpips.onnx") << "no network";
  const auto refused = Server::Start(options);
  EXPECT_TRUE(absl::IsInvalidArgument(refused.status())) << refused.status();
  EXPECT_NE(refused.status().message().find("lpips.onnx: not an ONNX network"), std::string::npos);
  options.lpips_weights = PEPESEG_TEST_DATA "/lpips/tiny.onnx";
  EXPECT_TRUE(Server::Start(options).ok());
}

TEST(ServerStart, RefusesAPriorsCommandThatIsNoProgram) {
  const testing::TempFolder folder;
  ServerOptions options;
  options.data = folder.path();
  options.worker = PEPESEG_FAKE_WORKER;
  std::ofstream(folder / "make_priors") << "not executable";
  for (const std::string& command : {(folder / "make_priors").string(), std::string("no-such")}) {
    options.priors_command = command;
    const auto refused = Server::Start(options);
    EXPECT_TRUE(absl::IsFailedPrecondition(refused.status())) << refused.status();
    EXPECT_NE(refused.status().message().find("priors command: "), std::string::npos);
  }
}

TEST(ServerStart, RefusesATakenPort) {
  RunningServer running(PEPESEG_FAKE_WORKER);
  const testing::TempFolder folder;
  ServerOptions options = running.options;
  options.data = folder.path();
  options.listen = "127.0.0.1:" + std::to_string(running.server->port());
  EXPECT_TRUE(absl::IsUnavailable(Server::Start(options).status()));
}

}  // namespace
}  // namespace pepeseg
