// The worker program on a real capture, through its job folder, as the supervisor runs it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/io/file_bytes.h"
#include "core/io/import.h"
#include "core/io/model_file.h"
#include "pepeseg/v1/dataset_service.pb.h"
#include "server/jobs/event_log.h"
#include "server/jobs/job_folder.h"
#include "server/jobs/process.h"
#include "tests/server/file_kind.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;

class WorkerTest : public ::testing::Test {
 protected:
  WorkerTest() : job_(folder_.path() / "j1") {
    std::filesystem::create_directories(job_.path());
    const auto files = ListDataset(PEPESEG_TEST_DATA "/apc_shelf");
    EXPECT_TRUE(files.ok()) << files.status();
    for (const DatasetFile& file : *files) {
      spec_.files.push_back({file.name, testing::ToProto(file.kind), file.path.string()});
    }
    spec_.job = "j1";
    spec_.fence = 1;
    spec_.num_threads = 2;
    // 80x60 pixels and few steps: all of the way, none of the quality.
    spec_.options.mutable_import()->set_image_scale(0.125);
    spec_.options.mutable_reconstruct()->set_num_steps(60);
    spec_.options.mutable_reconstruct()->set_num_random_points(500);
    spec_.options.mutable_features()->set_num_steps(20);
    spec_.options.mutable_features()->set_num_pixels(200);
    spec_.options.mutable_features()->set_steps_per_chunk(20);
  }

  std::unique_ptr<WorkerProcess> Launch(pid_t parent) {
    EXPECT_TRUE(job_.WriteSpec(spec_).ok());
    auto worker = WorkerProcess::Launch(
        {PEPESEG_WORKER,
         {absl::StrCat("--job=", job_.path().string()), absl::StrCat("--parent=", parent)},
         job_.worker_log()});
    EXPECT_TRUE(worker.ok()) << worker.status();
    return std::move(worker).value();
  }

  WorkerProcess::End WaitFor(WorkerProcess& worker) {
    for (int i = 0; i < 12000; ++i) {
      if (const auto end = worker.Poll()) return *end;
      absl::SleepFor(absl::Milliseconds(10));
    }
    ADD_FAILURE() << "the worker did not end within 120 s";
    return {};
  }

  WorkerProcess::End Run() { return WaitFor(*Launch(getpid())); }

  void ExpectExit(const WorkerProcess::End& end, WorkerExit exit) {
    EXPECT_EQ(end.signal, 0) << ReadFileTail(job_.worker_log(), 2000);
    EXPECT_EQ(end.exit_code, static_cast<int>(exit)) << ReadFileTail(job_.worker_log(), 2000);
  }

  // Runs, and wants it to fail for the file named, with nothing left of the attempt.
  void ExpectBadFile(const std::string& name) {
    ExpectExit(Run(), WorkerExit::kFailed);
    const auto result = job_.ReadResult(spec_.fence);
    ASSERT_TRUE(result.ok()) << result.status();
    EXPECT_EQ(result->status.code(), absl::StatusCode::kInvalidArgument) << result->status;
    EXPECT_THAT(std::string(result->status.message()), HasSubstr(name));
    EXPECT_FALSE(std::filesystem::exists(job_.attempt(spec_.fence)));
  }

  // The bytes of the file of a spec, replaced by those given.
  JobSpecFile& Replace(const std::string& name, const std::string& bytes) {
    for (JobSpecFile& file : spec_.files) {
      if (file.name != name) continue;
      file.path = (folder_.path() / "replaced").string();
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

bool HasProgress(const std::vector<v1::JobEvent>& events) {
  return std::any_of(events.begin(), events.end(),
                     [](const v1::JobEvent& event) { return event.has_progress(); });
}

TEST_F(WorkerTest, MakesAModelOfPhotographs) {
  ExpectExit(Run(), WorkerExit::kSucceeded);
  const auto result = job_.ReadResult(1);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_TRUE(result->status.ok()) << result->status;
  const auto model = ReadModel(job_.attempt(1));
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(model->gaussians.count, result->num_gaussians);
  EXPECT_EQ(model->field.features.size(), static_cast<size_t>(model->gaussians.count) * 32);
  EXPECT_EQ(model->views.size(), 15u);
  EXPECT_GT(model->metrics.at("psnr"), 5);
  EXPECT_GT(model->metrics.at("seconds_reconstruct"), 0);
  EXPECT_GT(model->metrics.at("num_masks"), 0);
  EXPECT_THAT(model->facts.at("options"), HasSubstr("\"numSteps\":60"));
  EXPECT_FALSE(std::filesystem::exists(job_.reconstruction(1)));
}

TEST_F(WorkerTest, TellsOfEveryStage) {
  ExpectExit(Run(), WorkerExit::kSucceeded);
  std::vector<std::string> stages;
  std::map<std::string, int64_t> last_steps;
  double psnr = 0;
  for (const v1::JobEvent& event : Events()) {
    if (event.has_stage_started()) stages.push_back(event.stage_started().stage());
    if (event.has_progress()) last_steps[event.progress().stage()] = event.progress().step();
    if (event.has_stage_ended() && event.stage_ended().metrics().contains("psnr")) {
      psnr = event.stage_ended().metrics().at("psnr");
    }
  }
  EXPECT_THAT(stages,
              ::testing::ElementsAre("prepare", "reconstruct", "evaluate", "features", "index"));
  EXPECT_EQ(last_steps["reconstruct"], 60);
  EXPECT_EQ(last_steps["features"], 20);
  EXPECT_GT(psnr, 5);
}

TEST_F(WorkerTest, StopsAtTheNextStepWhenToldTo) {
  spec_.options.mutable_reconstruct()->set_num_steps(1'000'000);
  const auto worker = Launch(getpid());
  for (int i = 0; i < 3000 && !HasProgress(Events()); ++i) {
    absl::SleepFor(absl::Milliseconds(10));
  }
  worker->Signal(SIGTERM);
  ExpectExit(WaitFor(*worker), WorkerExit::kCancelled);
  const auto result = job_.ReadResult(1);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->status.code(), absl::StatusCode::kCancelled);
  EXPECT_THAT(std::string(result->status.message()), HasSubstr("stage reconstruct"));
}

TEST_F(WorkerTest, ResumesAfterStageOneWithTheSameBytes) {
  ExpectExit(Run(), WorkerExit::kSucceeded);
  const auto unbroken = ReadFile(job_.attempt(1) / "gaussians.ply", "first", 1 << 30);
  ASSERT_TRUE(unbroken.ok()) << unbroken.status();
  // As a server that stopped during stage two would have left it.
  const auto model = ReadModel(job_.attempt(1));
  ASSERT_TRUE(model.ok()) << model.status();
  std::filesystem::remove_all(job_.attempt(1));
  std::filesystem::create_directories(job_.reconstruction(1));
  ASSERT_TRUE(WriteModel(job_.reconstruction(1), *model).ok());
  spec_.fence = 2;
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(ReadFileTail(job_.worker_log(), 100000), HasSubstr("was done by attempt 1"));
  EXPECT_EQ(ReadFile(job_.attempt(2) / "gaussians.ply", "second", 1 << 30).value_or(""), *unbroken);
  EXPECT_FALSE(std::filesystem::exists(job_.attempt(1)));
}

TEST_F(WorkerTest, NamesATruncatedPhotograph) {
  const std::string name = "images/frame-000003.jpg";
  const std::string bytes = BytesOf(name);
  Replace(name, bytes.substr(0, bytes.size() / 2));
  ExpectBadFile(name);
}

TEST_F(WorkerTest, NamesAPhotographThatIsNone) {
  Replace("images/frame-000003.jpg", "GIF89a no photograph");
  ExpectBadFile("images/frame-000003.jpg");
}

TEST_F(WorkerTest, SaysWhatItCannotAllocate) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers reserve more address space than any limit leaves";
#endif
  spec_.memory_limit = int64_t{400} << 20;
  // The photographs fit; so many Gaussians do not.
  std::erase_if(spec_.files, [](const JobSpecFile& file) {
    return file.name.find("points3D") != std::string::npos;
  });
  spec_.options.mutable_reconstruct()->set_num_random_points(10'000'000);
  spec_.options.mutable_reconstruct()->set_max_gaussians(10'000'000);
  ExpectExit(Run(), WorkerExit::kFailed);
  const auto result = job_.ReadResult(1);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(result->status.message()), HasSubstr("out of memory"));
}

TEST_F(WorkerTest, RefusesABrokenSpec) {
  const auto launch = [&] {
    auto worker = WorkerProcess::Launch(
        {PEPESEG_WORKER, {absl::StrCat("--job=", job_.path().string())}, job_.worker_log()});
    return WaitFor(**worker);
  };
  ExpectExit(launch(), WorkerExit::kBadSpec);  // none
  std::ofstream(job_.path() / "spec.json") << R"({"job": 3})";
  ExpectExit(launch(), WorkerExit::kBadSpec);
  EXPECT_THAT(ReadFileTail(job_.worker_log(), 2000), HasSubstr("spec.json"));
}

TEST_F(WorkerTest, DoesNotOutliveItsServer) {
  ExpectExit(WaitFor(*Launch(/*parent=*/1)), WorkerExit::kBadSpec);
  EXPECT_THAT(ReadFileTail(job_.worker_log(), 2000), HasSubstr("the server has ended"));
}

}  // namespace
}  // namespace pepeseg
