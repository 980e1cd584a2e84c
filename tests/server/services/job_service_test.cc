#include <gtest/gtest.h>

#include <thread>

#include "absl/time/clock.h"
#include "kernels/host_memory.h"
#include "server/server_parts.h"
#include "server/worker_protocol/job_folder.h"
#include "tests/server/running_server.h"
#include "tests/testing/fake_sam.h"

namespace pepeseg {
namespace {

struct Watched {
  std::vector<v1::JobEvent> events;
  grpc::Status status;
};

struct JobServiceTest : ::testing::Test {
  JobServiceTest() : running(PEPESEG_FAKE_WORKER) { running.CreateScene("shelf"); }

  grpc::Status Train(const v1::TrainSceneRequest& request) {
    grpc::ClientContext context;
    return running.jobs->TrainScene(&context, request, &job);
  }
  v1::TrainSceneRequest Request(const std::string& file) {
    v1::TrainSceneRequest request;
    request.set_scene("scenes/shelf");
    request.set_dataset(running.UploadAndSeal("shelf", {{file, "bytes"}}));
    return request;
  }
  Watched Watch(const std::string& name, std::optional<int64_t> after = std::nullopt) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    v1::WatchJobRequest request;
    request.set_name(name);
    if (after.has_value()) request.set_after_sequence(*after);
    const auto stream = running.jobs->WatchJob(&context, request);
    Watched watched;
    v1::JobEvent event;
    while (stream->Read(&event)) watched.events.push_back(event);
    watched.status = stream->Finish();
    return watched;
  }
  grpc::Status Cancel(const std::string& name) {
    grpc::ClientContext context;
    v1::CancelJobRequest request;
    request.set_name(name);
    return running.jobs->CancelJob(&context, request, &job);
  }
  void AwaitStage(const std::string& name) {
    const absl::Time deadline = absl::Now() + absl::Seconds(30);
    do {
      grpc::ClientContext context;
      v1::GetJobRequest request;
      request.set_name(name);
      ASSERT_TRUE(running.jobs->GetJob(&context, request, &job).ok());
    } while (!job.has_progress() && absl::Now() < deadline);
    ASSERT_TRUE(job.has_progress());
  }

  RunningServer running;
  v1::Job job;
};

TEST_F(JobServiceTest, TrainsAndReportsEverything) {
  auto request = Request("fine");
  request.mutable_options()->mutable_reconstruct()->set_num_steps(77);
  ASSERT_TRUE(Train(request).ok());
  EXPECT_EQ(job.name(), "jobs/j1");
  EXPECT_EQ(job.device(), "");  // not started yet
  EXPECT_EQ(job.effective_options().reconstruct().num_steps(), 77);
  EXPECT_TRUE(job.effective_options().features().has_learning_rate());
  const Watched watched = Watch(job.name());
  ASSERT_TRUE(watched.status.ok()) << watched.status.error_message();
  ASSERT_GE(watched.events.size(), 1u);
  EXPECT_TRUE(watched.events[0].has_snapshot());
  int64_t sequence = watched.events[0].sequence();
  for (size_t i = 1; i < watched.events.size(); ++i) {
    EXPECT_FALSE(watched.events[i].has_snapshot());
    EXPECT_GT(watched.events[i].sequence(), sequence);
    sequence = watched.events[i].sequence();
  }
  const v1::Job after = running.Await("jobs/j1");
  EXPECT_EQ(after.device().find("cpu (1 thread, "), 0u) << after.device();
  EXPECT_EQ(after.state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(after.model(), "scenes/shelf/models/1");
  EXPECT_EQ(after.scene(), "scenes/shelf");
  EXPECT_EQ(after.dataset(), "scenes/shelf/datasets/1");
  EXPECT_EQ(after.progress().step(), 3);
  EXPECT_TRUE(after.has_start_time());
  EXPECT_FALSE(after.has_error());
}

TEST_F(JobServiceTest, GivesTheWorkerTheRemainingMemory) {
  running.options.model_bytes = int64_t{512} << 20;
  running.Restart();
  ASSERT_TRUE(Train(Request("fine")).ok());
  running.Await(job.name());
  const auto spec = JobFolder(running.options.data / "jobs" / "j1").ReadSpec(1);
  ASSERT_TRUE(spec.ok()) << spec.status();
  EXPECT_EQ(spec->memory_limit, WorkerMemory(running.options));
  EXPECT_LT(spec->memory_limit, HostMemory().total_bytes);
}

TEST_F(JobServiceTest, ResumesAWatch) {
  ASSERT_TRUE(Train(Request("fine")).ok());
  running.Await(job.name());
  const Watched all = Watch(job.name(), 0);
  ASSERT_TRUE(all.status.ok()) << all.status.error_message();
  ASSERT_GE(all.events.size(), 3u) << "the snapshot, progress, the end";
  EXPECT_EQ(all.events[0].sequence(), 0);
  EXPECT_EQ(all.events[0].snapshot().state(), v1::JOB_STATE_SUCCEEDED);
  const v1::JobEvent& last = all.events.back();
  ASSERT_TRUE(last.has_state_changed()) << last.DebugString();
  EXPECT_EQ(last.state_changed().state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(last.state_changed().model(), "scenes/shelf/models/1");

  const Watched rest = Watch(job.name(), all.events[1].sequence());
  ASSERT_TRUE(rest.status.ok());
  ASSERT_EQ(rest.events.size(), all.events.size() - 1);
  EXPECT_EQ(rest.events[1].sequence(), all.events[2].sequence());

  const Watched none = Watch(job.name(), last.sequence());
  EXPECT_TRUE(none.status.ok());
  EXPECT_EQ(none.events.size(), 1u);
  const Watched beyond = Watch(job.name(), last.sequence() + 1);
  EXPECT_EQ(beyond.status.error_code(), grpc::OUT_OF_RANGE);
  EXPECT_EQ(DetailOf(beyond.status).limit(), std::to_string(last.sequence()));
  EXPECT_EQ(Watch(job.name(), -1).status.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(Watch("jobs/j99").status.error_code(), grpc::NOT_FOUND);
  EXPECT_EQ(Watch("jobs/../x").status.error_code(), grpc::INVALID_ARGUMENT);
}

TEST_F(JobServiceTest, ReportsWhyAJobFailed) {
  ASSERT_TRUE(Train(Request("fail")).ok());
  const Watched watched = Watch(job.name(), 0);
  ASSERT_TRUE(watched.status.ok());
  const v1::Job failed = running.Await(job.name());
  EXPECT_EQ(failed.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(failed.error().code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(failed.error().reason(), "INVALID_ARGUMENT");
  EXPECT_NE(failed.error().message().find("images/bad.jpg"), std::string::npos);
  // A crash of the worker ends the job, not the server, and the next job runs.
  ASSERT_TRUE(Train(Request("crash")).ok());
  EXPECT_EQ(running.Await(job.name()).state(), v1::JOB_STATE_FAILED);
  ASSERT_TRUE(Train(Request("fine")).ok());
  EXPECT_EQ(running.Await(job.name()).state(), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(JobServiceTest, RefusesInvalidTrainings) {
  const auto good = Request("fine");
  auto request = good;
  request.set_dataset("scenes/shelf/datasets/9");
  EXPECT_EQ(Train(request).error_code(), grpc::NOT_FOUND);
  request.set_dataset("scenes/other/datasets/1");
  EXPECT_EQ(DetailOf(Train(request)).field(), "dataset");
  request = good;
  request.set_scene("shelf");
  EXPECT_EQ(Train(request).error_code(), grpc::INVALID_ARGUMENT);
  request = good;
  request.mutable_options()->mutable_import()->set_image_scale(2);
  const grpc::Status status = Train(request);
  EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_NE(status.error_message().find("image_scale"), std::string::npos)
      << status.error_message();
  const v1::Upload open = running.CreateUpload("shelf", {{"x", "y"}});
  request = good;
  request.set_dataset("scenes/shelf/datasets/2");
  EXPECT_EQ(open.name(), "scenes/shelf/uploads/2");
  EXPECT_EQ(Train(request).error_code(), grpc::FAILED_PRECONDITION);
}

TEST_F(JobServiceTest, RefusesACommandThatItDoesNotHave) {
  auto request = Request("fine");
  request.mutable_options()->mutable_priors()->set_masks(v1::PRIOR_MAKER_COMMAND);
  const grpc::Status refused = Train(request);
  EXPECT_EQ(refused.error_code(), grpc::FAILED_PRECONDITION);
  EXPECT_NE(refused.error_message().find("options.priors.masks"), std::string::npos);
  EXPECT_NE(refused.error_message().find("--priors-command"), std::string::npos);
  running.options.workers.priors_command = "true";
  running.Restart();
  EXPECT_TRUE(Train(request).ok());
}

TEST_F(JobServiceTest, RefusesSamThatItDoesNotHave) {
  auto request = Request("fine");
  for (const v1::PriorMaker maker : {v1::PRIOR_MAKER_SAM, v1::PRIOR_MAKER_SAM_AND_EMBEDDED}) {
    request.mutable_options()->mutable_priors()->set_masks(maker);
    const grpc::Status refused = Train(request);
    EXPECT_EQ(refused.error_code(), grpc::FAILED_PRECONDITION);
    EXPECT_NE(refused.error_message().find("deploy/sam.sh"), std::string::npos);
  }
  testing::MakeFakeSam(running.folder / "sam");
  running.options.workers.sam = running.folder / "sam";
  running.Restart();
  EXPECT_TRUE(Train(request).ok());
}

TEST_F(JobServiceTest, QueuesNothingForValidateOnly) {
  auto request = Request("fine");
  request.set_validate_only(true);
  request.mutable_options()->mutable_features()->set_num_steps(5);
  ASSERT_TRUE(Train(request).ok());
  EXPECT_EQ(job.name(), "");
  EXPECT_EQ(job.effective_options().features().num_steps(), 5);
  grpc::ClientContext context;
  v1::ListJobsResponse list;
  ASSERT_TRUE(running.jobs->ListJobs(&context, v1::ListJobsRequest(), &list).ok());
  EXPECT_EQ(list.jobs_size(), 0);
}

TEST_F(JobServiceTest, RunsOneTrainingOfASceneAtATime) {
  auto request = Request("hang");
  request.set_request_id("r1");
  ASSERT_TRUE(Train(request).ok());
  const std::string first = job.name();
  ASSERT_TRUE(Train(request).ok()) << "a retry";
  EXPECT_EQ(job.name(), first);
  request.set_request_id("r2");
  const grpc::Status second = Train(request);
  EXPECT_EQ(second.error_code(), grpc::ABORTED);
  EXPECT_EQ(DetailOf(second).resource(), first);
  ASSERT_TRUE(Cancel(first).ok());
  EXPECT_EQ(running.Await(first).state(), v1::JOB_STATE_CANCELLED);
  EXPECT_TRUE(Cancel(first).ok()) << "of one that has ended";
  EXPECT_EQ(Cancel("jobs/j99").error_code(), grpc::NOT_FOUND);
}

TEST_F(JobServiceTest, ListsByStateAndPage) {
  for (const char* file : {"fine", "fail", "fine"}) {
    ASSERT_TRUE(Train(Request(file)).ok());
    running.Await(job.name());
  }
  v1::ListJobsRequest request;
  request.set_state(v1::JOB_STATE_SUCCEEDED);
  request.set_page_size(1);
  std::vector<std::string> names;
  do {
    grpc::ClientContext context;
    v1::ListJobsResponse list;
    ASSERT_TRUE(running.jobs->ListJobs(&context, request, &list).ok());
    for (const v1::Job& one : list.jobs()) names.push_back(one.name());
    request.set_page_token(list.next_page_token());
  } while (!request.page_token().empty());
  EXPECT_EQ(names, (std::vector<std::string>{"jobs/j3", "jobs/j1"}));
}

TEST_F(JobServiceTest, FreesWatchersThatDisconnect) {
  ASSERT_TRUE(Train(Request("hang")).ok());
  const std::string name = job.name();
  AwaitStage(name);
  std::vector<std::thread> threads;
  threads.reserve(20);
  for (int i = 0; i < 20; ++i) {
    threads.emplace_back([&] {
      grpc::ClientContext context;
      v1::WatchJobRequest request;
      request.set_name(name);
      const auto stream = running.jobs->WatchJob(&context, request);
      v1::JobEvent event;
      EXPECT_TRUE(stream->Read(&event));
      context.TryCancel();
      while (stream->Read(&event)) {
      }
      EXPECT_EQ(stream->Finish().error_code(), grpc::CANCELLED);
    });
  }
  for (std::thread& thread : threads) thread.join();
  // A watcher that stays sees the end.
  std::thread canceller([&] {
    absl::SleepFor(absl::Milliseconds(200));
    v1::Job unused;
    grpc::ClientContext context;
    v1::CancelJobRequest request;
    request.set_name(name);
    EXPECT_TRUE(running.jobs->CancelJob(&context, request, &unused).ok());
  });
  const Watched watched = Watch(name);
  canceller.join();
  ASSERT_TRUE(watched.status.ok()) << watched.status.error_message();
  ASSERT_GE(watched.events.size(), 2u);
  EXPECT_EQ(watched.events.back().state_changed().state(), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobServiceTest, EndsAWatchAtItsDeadline) {
  ASSERT_TRUE(Train(Request("hang")).ok());
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::milliseconds(500));
  v1::WatchJobRequest request;
  request.set_name(job.name());
  const auto stream = running.jobs->WatchJob(&context, request);
  v1::JobEvent event;
  while (stream->Read(&event)) {
  }
  EXPECT_EQ(stream->Finish().error_code(), grpc::DEADLINE_EXCEEDED);
}

}  // namespace
}  // namespace pepeseg
