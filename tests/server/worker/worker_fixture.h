#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/base/file_io.h"
#include "core/dataset/import.h"
#include "pepeseg/v1/dataset_service.pb.h"
#include "server/jobs/launcher.h"
#include "server/worker_protocol/event_log.h"
#include "server/worker_protocol/job_folder.h"
#include "tests/server/file_kind.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {

// Runs the worker program on a real capture with a job folder, as the supervisor does.
class WorkerTest : public ::testing::Test {
 protected:
  WorkerTest() : job_(folder_.path() / "j1") {
    EXPECT_OK(job_.Make());
    const auto files = ListDataset(PEPESEG_TEST_DATA "/apc_shelf");
    EXPECT_OK(files);
    for (const DatasetFile& file : *files) {
      spec_.files.push_back({file.name, testing::ToProto(file.kind), file.path.string(), ""});
    }
    spec_.job = "j1";
    spec_.fence = 1;
    spec_.device = "cpu";
    spec_.num_threads = 2;
    // 80x60 pixels and few steps: all stages run, and quality does not matter.
    spec_.options.mutable_import()->set_image_scale(0.125);
    spec_.options.mutable_reconstruct()->set_num_steps(60);
    (*spec_.options.mutable_advanced())["reconstruct.num_random_points"] = "500";
    spec_.options.mutable_features()->set_num_steps(20);
    (*spec_.options.mutable_advanced())["features.num_pixels"] = "200";
    (*spec_.options.mutable_advanced())["features.steps_per_chunk"] = "20";
  }

  // Writes the spec with the digest of each file, as the supervisor does. Keeps digests that are
  // set.
  void WriteSpec() {
    for (JobSpecFile& file : spec_.files) {
      if (file.sha256.empty()) file.sha256 = Sha256OfFile(file.path).value_or("");
    }
    EXPECT_OK(job_.WriteSpec(spec_));
  }

  std::unique_ptr<WorkerProcess> Launch(pid_t parent) {
    WriteSpec();
    const std::vector<std::string> arguments = {absl::StrCat("--job=", job_.path().string()),
                                                absl::StrCat("--parent=", parent)};
    auto worker = WorkerProcess::Launch({PEPESEG_WORKER, arguments, job_.worker_log()});
    EXPECT_OK(worker);
    return std::move(worker).value();
  }

  WorkerEnd WaitFor(WorkerProcess& worker) {
    std::optional<WorkerEnd> end;
    EXPECT_TRUE(
        testing::Eventually([&] { return (end = worker.Poll()).has_value(); }, absl::Minutes(2)));
    return end.value_or(WorkerEnd());
  }

  WorkerEnd Run() { return WaitFor(*Launch(getpid())); }

  void ExpectExit(const WorkerEnd& end, WorkerExit exit) {
    EXPECT_EQ(end.signal, 0) << ReadFileTail(job_.worker_log(), 2000);
    EXPECT_EQ(end.exit_code, static_cast<int>(exit)) << ReadFileTail(job_.worker_log(), 2000);
  }

  // Runs the worker, and expects it to fail with an error that names the file, and to leave nothing
  // of the attempt.
  void ExpectBadFile(const std::string& name) {
    ExpectExit(Run(), WorkerExit::kFailed);
    ASSERT_OK_AND_ASSIGN(const auto result, job_.ReadResult(spec_.fence));
    EXPECT_EQ(result.status.code(), absl::StatusCode::kInvalidArgument) << result.status;
    EXPECT_THAT(std::string(result.status.message()), ::testing::HasSubstr(name));
    EXPECT_FALSE(std::filesystem::exists(job_.attempt(spec_.fence)));
  }

  // Replaces the bytes of a file of the spec.
  JobSpecFile& Replace(const std::string& name, const std::string& bytes) {
    for (JobSpecFile& file : spec_.files) {
      if (file.name != name) continue;
      file.path = (folder_.path() / "replaced").string();
      file.sha256.clear();
      std::ofstream(file.path, std::ios::binary) << bytes;
      return file;
    }
    ADD_FAILURE() << "no file " << name;
    return spec_.files.front();
  }

  std::string BytesOf(const std::string& name) {
    return ReadFile(PEPESEG_TEST_DATA "/apc_shelf/" + name, name, 1 << 30).value_or("");
  }

  std::vector<v1::JobEvent> Events() {
    EventLogReader reader(job_.events());
    return reader.Read(100000).value_or(std::vector<v1::JobEvent>());
  }

  testing::TempFolder folder_;
  JobFolder job_;
  JobSpec spec_;
};

}  // namespace pepeseg
