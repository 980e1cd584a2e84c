#include "tests/system/stress/io_fault_lives.h"

#include <gtest/gtest.h>

#include <csignal>
#include <fstream>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "tests/server/pepesegd_process.h"
#include "tests/system/stress/life_of_a_scene.h"
#include "tests/system/stress/unclean_data.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using testing::PepesegdOptions;
using testing::PepesegdProcess;

const std::vector<std::string> kDurableCalls = {"fsync", "fdatasync", "syncfs", "rename", "unlink"};
const std::vector<std::string> kSpaceCalls = {"write", "fsync", "fdatasync", "syncfs"};

PepesegdOptions Options(std::vector<std::string> environment = {}) {
  return {{}, std::move(environment), PEPESEG_MODEL_WORKER, "", /*may_end=*/true};
}

// Returns the number of calls that can be broken in a life without a fault.
int64_t CountCalls(const std::vector<std::string>& names) {
  const testing::TempFolder folder;
  const std::filesystem::path data = folder / "data";
  std::vector<std::string> environment = FaultEnvironment(data, "");
  environment.push_back("PEPESEG_FAULT_TRACE=" + (folder / "trace").string());
  PepesegdProcess server(data, Options(environment));
  LifeOfAScene life("first");
  EXPECT_OK(life.Run(server.channel()));
  server.Terminate();
  return static_cast<int64_t>(TracedPaths(folder / "trace", names).size());
}

// Records the code with which a life ended, and the reason if its job makes no progress.
std::string EndOf(const absl::Status& status) {
  const bool waits = absl::IsUnavailable(status) &&
                     absl::StrContains(status.message(), "the server's disk is full");
  return absl::StrCat(absl::StatusCodeToString(status.code()), waits ? " for a full disk" : "");
}

// Runs a life under a fault until an error, then to its end without one.
void TryFault(const std::string& fault, FaultReport& report) {
  const testing::TempFolder folder;
  const std::filesystem::path data = folder / "data";
  LifeOfAScene life("first");
  // A file that cannot be read after the worker's end fails its training.
  const bool may_fail = fault.starts_with("unreadable");
  if (may_fail) life.LetTrainingFail();
  ++report.num_tried;
  {
    PepesegdProcess server(data, Options(FaultEnvironment(data, fault)));
    if (server.alive()) {
      const absl::Status status = life.Run(server.channel());
      ++report.codes[EndOf(status)];
      report.examples.try_emplace(EndOf(status), absl::StrCat(fault, ": ", status.message()));
      if (life.found_wrong()) {
        report.broken.push_back(absl::StrCat(fault, ": ", status.ToString()));
      }
    } else {
      ++report.codes["did not start"];
    }
    // The kill may also come at a call of the shutdown.
    const auto end = server.Terminate();
    if (!end.has_value()) report.broken.push_back(absl::StrCat(fault, ": does not end"));
    if (end.has_value() && end->signal == SIGKILL) ++report.num_killed;
    if (end.has_value() && end->signal != SIGKILL && end->signal != 0) {
      report.broken.push_back(absl::StrCat(fault, ": signal ", end->signal, server.Log()));
    }
  }
  PepesegdProcess server(data, Options());
  absl::Status status = life.Check(server.channel());
  if (status.ok()) status = life.Run(server.channel());
  if (!status.ok() && may_fail) status = life.Run(server.channel());  // trains again
  if (!status.ok()) report.broken.push_back(absl::StrCat(fault, ": ", status.ToString()));
  server.Terminate();
  for (const std::string& what : FindUnclean(data)) {
    report.unclean.push_back(absl::StrCat(fault, ": ", what));
  }
}

FaultReport TryEach(const std::vector<std::string>& kinds, int64_t num_points, int stride) {
  FaultReport report;
  report.num_points = num_points;
  for (int64_t point = 1; point <= num_points; point += stride) {
    for (const std::string& kind : kinds) TryFault(absl::StrCat(kind, ":", point), report);
  }
  return report;
}

}  // namespace

std::string FaultReport::ToString() const {
  return absl::StrCat(num_points, " points, ", num_tried, " tried, ", num_killed, " killed; ",
                      absl::StrJoin(codes, ", ", absl::PairFormatter(" ")), "; first of each: ",
                      absl::StrJoin(examples, ", ", absl::PairFormatter(" at ")),
                      "; broken: ", broken.size(), " ", absl::StrJoin(broken, "; "),
                      "; unclean: ", unclean.size(), " ", absl::StrJoin(unclean, "; "));
}

std::vector<std::string> FaultEnvironment(const std::filesystem::path& data,
                                          const std::string& fault) {
  std::vector<std::string> environment = {absl::StrCat("LD_PRELOAD=", PEPESEG_IO_FAULTS),
                                          "PEPESEG_FAULT_PROGRAM=pepesegd",
                                          "PEPESEG_FAULT_FOLDER=" + data.string()};
  if (!fault.empty()) environment.push_back("PEPESEG_FAULT=" + fault);
  return environment;
}

std::vector<std::string> TracedPaths(const std::filesystem::path& trace,
                                     const std::vector<std::string>& names) {
  std::vector<std::string> paths;
  std::ifstream lines(trace);
  for (std::string line; std::getline(lines, line);) {
    const size_t space = line.find(' ');
    for (const std::string& name : names) {
      if (line.substr(0, space) == name) paths.push_back(line.substr(space + 1));
    }
  }
  return paths;
}

std::map<std::string, int64_t> CountDurableCalls(
    const std::function<void(const std::shared_ptr<grpc::Channel>&)>& use) {
  const testing::TempFolder folder;
  std::vector<std::string> environment = FaultEnvironment(folder / "data", "");
  environment.push_back("PEPESEG_FAULT_TRACE=" + (folder / "trace").string());
  PepesegdProcess server(folder / "data", Options(environment));
  std::map<std::string, int64_t> counts;
  const auto count = [&](const std::string& name) {
    return static_cast<int64_t>(TracedPaths(folder / "trace", {name}).size());
  };
  for (const std::string& name : kDurableCalls) counts[name] = -count(name);
  use(server.channel());
  for (const std::string& name : kDurableCalls) counts[name] += count(name);
  return counts;
}

FaultReport KillAtEveryDurableCall(int stride) {
  return TryEach({"kill-before", "kill-after"}, CountCalls(kDurableCalls), stride);
}

FaultReport FillDiskAtEveryCall(int stride) {
  return TryEach({"full"}, CountCalls(kSpaceCalls), stride);
}

FaultReport FailEveryRead(int stride) {
  return TryEach({"unreadable"}, CountCalls({"read"}), stride);
}

}  // namespace pepeseg
