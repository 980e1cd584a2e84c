// Options with which a server does not start.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "server/server_parts.h"
#include "server/store/layout.h"
#include "tests/server/running_server.h"
#include "tests/testing/fake_sam.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

ServerOptions OptionsIn(const testing::TempFolder& folder) {
  ServerOptions options;
  options.data = folder.path();
  options.worker = PEPESEG_FAKE_WORKER;
  return options;
}

TEST(ServerStart, RefusesToServeOtherMachinesUnlessInsecure) {
  const testing::TempFolder folder;
  ServerOptions options = OptionsIn(folder);
  options.listen = "0.0.0.0:0";
  EXPECT_STATUS(Server::Start(options), absl::StatusCode::kFailedPrecondition, "--insecure");
  options.insecure = true;
  EXPECT_OK(Server::Start(options));
}

TEST(ServerStart, RefusesAMissingWorkerAndADataDirectoryInUse) {
  const testing::TempFolder folder;
  ServerOptions options;
  options.data = folder.path();
  options.worker = "/no/such/program";
  EXPECT_TRUE(absl::IsFailedPrecondition(Server::Start(options).status()));
  options.worker = PEPESEG_FAKE_WORKER;
  ASSERT_OK_AND_ASSIGN(auto first, Server::Start(options));
  EXPECT_STATUS(Server::Start(options), absl::StatusCode::kFailedPrecondition, "another server");
  first.reset();
  EXPECT_OK(Server::Start(options));
}

// The default data directory is in the home directory, which not everybody knows.
TEST(ServerStart, NamesTheFileOfADatabaseThatDoesNotOpen) {
  const testing::TempFolder folder;
  const std::filesystem::path file = DatabasePath(folder.path());
  std::ofstream(file) << std::string(5000, 'x');
  const absl::Status status = Server::Start(OptionsIn(folder)).status();
  EXPECT_FALSE(status.ok());
  EXPECT_NE(status.message().find(file.string() + ": "), absl::string_view::npos) << status;
}

TEST(ServerStart, RefusesADeviceThatIsNotAvailable) {
  const testing::TempFolder folder;
  ServerOptions options = OptionsIn(folder);
  options.devices = "cuda:1000";
  EXPECT_STATUS(Server::Start(options), absl::StatusCode::kFailedPrecondition,
                "device cuda:1000: ");
}

TEST(ServerStart, RefusesAFileThatIsNotWeights) {
  const testing::TempFolder folder;
  ServerOptions options = OptionsIn(folder);
  options.workers.lpips_weights = folder / "none.onnx";
  EXPECT_EQ(Server::Start(options).status().code(), absl::StatusCode::kNotFound);
  options.workers.lpips_weights = testing::MakeLpips(folder / "lpips");
  EXPECT_OK(Server::Start(options));
  std::ofstream(options.workers.lpips_weights) << "no network";
  EXPECT_STATUS(Server::Start(options), absl::StatusCode::kInvalidArgument, "lpips.onnx: ");
}

TEST(ServerStart, RefusesAPriorsCommandThatIsNotAProgram) {
  const testing::TempFolder folder;
  ServerOptions options;
  options.data = folder.path();
  options.worker = PEPESEG_FAKE_WORKER;
  std::ofstream(folder / "make_priors") << "not executable";
  for (const std::string& command : {(folder / "make_priors").string(), std::string("no-such")}) {
    options.workers.priors_command = command;
    EXPECT_STATUS(Server::Start(options), absl::StatusCode::kFailedPrecondition,
                  "priors command: ");
  }
}

TEST(ServerStart, RefusesADamagedSamFolderThatIsNamed) {
  const testing::TempFolder folder;
  ServerOptions options = OptionsIn(folder);
  options.workers.sam = folder / "sam";
  EXPECT_EQ(Server::Start(options).status().code(), absl::StatusCode::kNotFound);
  testing::MakeFakeSam(folder / "sam");
  EXPECT_OK(Server::Start(options));
  std::ofstream(folder / "sam" / "sam.onnx") << "another model";
  EXPECT_STATUS(Server::Start(options), absl::StatusCode::kFailedPrecondition,
                "sam.onnx: its SHA-256 is ");
}

// A damaged default folder does not keep the server from starting.
TEST(ServerStart, UsesSamInADefaultFolderIfItIsIntact) {
  const testing::TempFolder folder;
  ServerOptions options = OptionsIn(folder);
  options.default_sam = {folder / "none", folder / "sam"};
  EXPECT_EQ(FindSam(options).value_or("?"), "");
  testing::MakeFakeSam(folder / "sam");
  EXPECT_EQ(FindSam(options).value_or("?"), folder / "sam");
  std::ofstream(folder / "sam" / "sam.onnx") << "another model";
  EXPECT_EQ(FindSam(options).value_or("?"), "");
  EXPECT_OK(Server::Start(options));
}

TEST(ServerStart, UsesADetectorIfItIsIntact) {
  const testing::TempFolder folder;
  ServerOptions options = OptionsIn(folder);
  options.default_detector = {folder / "none", folder / "detector"};
  EXPECT_EQ(FindDetector(options).value_or("?"), "");
  testing::MakeFakeDetector(folder / "detector");
  EXPECT_EQ(FindDetector(options).value_or("?"), folder / "detector");
  std::ofstream(folder / "detector" / "words.txt") << "other words";
  EXPECT_EQ(FindDetector(options).value_or("?"), "");
  options.detector = folder / "detector";
  EXPECT_STATUS(Server::Start(options), absl::StatusCode::kFailedPrecondition,
                "words.txt: its SHA-256 is ");
}

TEST(ServerStart, RefusesATextCommandThatIsNotAProgram) {
  const testing::TempFolder folder;
  ServerOptions options = OptionsIn(folder);
  options.text_command = "no-such";
  EXPECT_STATUS(Server::Start(options), absl::StatusCode::kFailedPrecondition, "text command: ");
}

TEST(ServerStart, RefusesAPortInUse) {
  RunningServer running(PEPESEG_FAKE_WORKER);
  const testing::TempFolder folder;
  ServerOptions options = running.options;
  options.data = folder.path();
  options.listen = "127.0.0.1:" + std::to_string(running.server->port());
  const auto refused = Server::Start(options);
  EXPECT_TRUE(absl::IsUnavailable(refused.status())) << refused.status();
  const std::string message(refused.status().message());
  EXPECT_NE(message.find("--listen " + options.listen + ": the port is in use"), std::string::npos)
      << message;
  EXPECT_EQ(message.find('\n'), std::string::npos);
}

TEST(ServerStart, NamesTheFlagOfAnAddressThatCannotBeBound) {
  const RunningServer running(PEPESEG_FAKE_WORKER);
  const testing::TempFolder folder;
  ServerOptions options = OptionsIn(folder);
  options.metrics = "127.0.0.1:" + std::to_string(running.server->port());
  EXPECT_NE(Server::Start(options).status().message().find("--metrics 127."), std::string::npos);
  options.metrics.clear();
  options.insecure = true;
  options.listen = "192.0.2.1:0";  // reserved by RFC 5737: no machine has it
  const auto refused = Server::Start(options);
  EXPECT_NE(refused.status().message().find("not an address of this machine"), std::string::npos)
      << refused.status();
}

TEST(ServerStart, CreatesTheDataDirectoryForItsOwnerOnly) {
  const testing::TempFolder folder;
  ServerOptions options = OptionsIn(folder);
  options.data = folder / "share" / "pepeseg";
  ASSERT_OK(Server::Start(options));
  const auto mode = std::filesystem::status(options.data).permissions();
  EXPECT_EQ(mode, std::filesystem::perms::owner_all);
}

}  // namespace
}  // namespace pepeseg
