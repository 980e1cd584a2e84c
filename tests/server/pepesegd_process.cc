#include "tests/server/pepesegd_process.h"

#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/file_io.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::testing {
namespace {

constexpr absl::Duration kProcessPatience = absl::Seconds(30);

}  // namespace

PepesegdProcess::PepesegdProcess(const std::filesystem::path& data, const PepesegdOptions& options)
    : log_(data) {
  log_ += options.name + ".log";
  std::filesystem::path port_file = data;
  port_file += options.name + ".port";
  std::filesystem::remove(port_file);
  std::vector<std::string> arguments = {
      absl::StrCat("--data=", data.string()),
      "--sam=off",
      "--listen=" + options.listen,
      "--threads=2",
      "--grace=5",
      absl::StrCat("--worker=", options.worker.empty() ? PEPESEG_WORKER : options.worker.string()),
      absl::StrCat("--port-file=", port_file.string())};
  arguments.insert(arguments.end(), options.arguments.begin(), options.arguments.end());
  auto process = WorkerProcess::Launch({PEPESEG_PEPESEGD, arguments, log_, options.environment});
  EXPECT_OK(process);
  if (!process.ok()) return;
  process_ = std::move(process).value();
  const absl::Time deadline = absl::Now() + kProcessPatience;
  const auto started =
      Eventually([&] { return std::filesystem::exists(port_file) || !alive(); }, kProcessPatience);
  int port = 0;
  std::ifstream(port_file) >> port;
  channel_ = grpc::CreateChannel(
      absl::StrCat("127.0.0.1:", port),
      options.credentials ? options.credentials : grpc::InsecureChannelCredentials());
  bool connected = false;
  while (started && !connected && alive() && absl::Now() < deadline) {
    connected = channel_->WaitForConnected(std::chrono::system_clock::now() +
                                           std::chrono::milliseconds(200));
  }
  EXPECT_TRUE(connected || options.may_end) << Log();
}

std::string PepesegdProcess::Log() const { return ReadFileTail(log_, 5000); }

std::optional<WorkerEnd> PepesegdProcess::Terminate() {
  process_->Signal(SIGTERM);
  std::optional<WorkerEnd> end;
  if (!Eventually([&] { return (end = process_->Poll()).has_value(); }, kProcessPatience))
    return {};
  return end;
}

void PepesegdProcess::Kill() { process_.reset(); }

pid_t FindProcess(const std::string& word) {
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    std::ifstream file(entry.path() / "cmdline");
    std::ostringstream words;
    words << file.rdbuf();  // does not throw if the process ends meanwhile
    if (words.str().find(word) != std::string::npos) return std::stoi(entry.path().filename());
  }
  return 0;
}

}  // namespace pepeseg::testing
