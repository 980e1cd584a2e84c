// A disk that cannot read what the worker reads: its inputs, its checkpoints, files that it has
// just written. The job fails with an error that does not blame the user, or its model has the same
// bytes.
#include <map>
#include <set>

#include "absl/strings/match.h"
#include "core/base/digest.h"
#include "tests/server/worker/worker_fixture.h"
#include "tests/system/stress/io_fault_lives.h"
#include "tests/testing/full_stress.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

class UnreadableInputs : public WorkerTest {
 protected:
  UnreadableInputs() {
    // The files are below the folder, as those of a job.
    int count = 0;
    for (JobSpecFile& file : spec_.files) {
      const std::filesystem::path copy = folder_ / absl::StrCat("blob-", ++count, ".bytes");
      std::filesystem::copy_file(file.path, copy);
      file.path = copy;
    }
    spec_.checkpoint_steps = 20;
    spec_.worker.sandbox = false;  // the faults look into /proc
  }

  // Runs attempt 1 of a new job under the faults, and returns the model's bytes.
  absl::StatusOr<std::string> Train(const std::vector<std::string>& faults) {
    std::filesystem::remove_all(job_.path());
    std::filesystem::create_directories(job_.path());
    WriteSpec();
    std::vector<std::string> environment = {
        absl::StrCat("LD_PRELOAD=", PEPESEG_IO_FAULTS), "PEPESEG_FAULT_PROGRAM=pepeseg-worker",
        absl::StrCat("PEPESEG_FAULT_FOLDER=", folder_.path().string())};
    environment.insert(environment.end(), faults.begin(), faults.end());
    auto worker = WorkerProcess::Launch(
        {PEPESEG_WORKER,
         {absl::StrCat("--job=", job_.path().string()), absl::StrCat("--parent=", getpid())},
         job_.worker_log(),
         environment});
    EXPECT_OK(worker);
    const WorkerEnd end = WaitFor(**worker);
    EXPECT_EQ(end.signal, 0) << ReadFileTail(job_.worker_log(), 2000);
    if (end.exit_code == static_cast<int>(WorkerExit::kBadSpec)) {
      return absl::InternalError("bad spec");
    }
    const auto result = job_.ReadResult(1);
    EXPECT_OK(result) << ReadFileTail(job_.worker_log(), 2000);
    if (!result.ok() || !result->status.ok()) return result.ok() ? result->status : result.status();
    std::string all;
    for (const char* name : {"gaussians.ply", "features.bin"}) {
      all += Sha256Hex(ReadFile(job_.attempt(1) / name, name, 1 << 30).value_or(""));
    }
    return all;
  }

  // Returns the paths that the worker reads, in the order of its calls.
  std::vector<std::string> TraceReads() {
    const std::filesystem::path trace = folder_ / "trace";
    EXPECT_OK(Train({"PEPESEG_FAULT_TRACE=" + trace.string()}));
    return TracedPaths(trace, {"read"});
  }
};

// One call of read() fails.
TEST_F(UnreadableInputs, FailTheJobAtEachRead) {
  const std::vector<std::string> reads = TraceReads();
  ASSERT_OK_AND_ASSIGN(const auto whole, Train({}));
  const size_t step = testing::FullStress() ? 1 + reads.size() / 200 : 1 + reads.size() / 8;
  int num_failed = 0, num_tried = 0;
  for (size_t i = 0; i < reads.size(); i += step, ++num_tried) {
    const auto model = Train({absl::StrCat("PEPESEG_FAULT=unreadable:", i + 1)});
    if (model.ok()) {
      EXPECT_EQ(*model, whole) << reads[i];
      continue;
    }
    ++num_failed;
    EXPECT_TRUE(absl::IsInternal(model.status()) || absl::IsDataLoss(model.status()))
        << reads[i] << ": " << model.status();
  }
  std::cout << reads.size() << " reads, " << num_tried << " tried, " << num_failed
            << " jobs failed\n";
  EXPECT_GE(reads.size(), 50u);
  EXPECT_GE(num_failed, num_tried / 2);
}

// A file of each kind fails permanently.
TEST_F(UnreadableInputs, AreNamedForEachKindOfFile) {
  std::map<int, const JobSpecFile*> by_kind;
  for (const JobSpecFile& file : spec_.files) by_kind.emplace(file.kind, &file);
  ASSERT_GE(by_kind.size(), 4u);
  for (const auto& [kind, file] : by_kind) {
    const auto model =
        Train({"PEPESEG_FAULT=unreadable-from:1",
               "PEPESEG_FAULT_FILE=" + std::filesystem::path(file->path).filename().string()});
    EXPECT_EQ(model.status().code(), absl::StatusCode::kInternal) << file->name << model.status();
    EXPECT_THAT(std::string(model.status().message()), ::testing::HasSubstr(file->name));
  }
}

}  // namespace
}  // namespace pepeseg
