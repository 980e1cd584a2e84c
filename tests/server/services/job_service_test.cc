#include <gtest/gtest.h>

#include <thread>

#include "core/train/settings/training_settings.h"
#include "kernels/host_memory.h"
#include "server/server_parts.h"
#include "server/worker_protocol/job_folder.h"
#include "tests/server/service_test.h"
#include "tests/testing/fake_sam.h"

namespace pepeseg {
namespace {

struct Watched {
  std::vector<v1::JobEvent> events;
  grpc::Status status;
};

struct JobServiceTest : EmptyScene {
  JobServiceTest() : EmptyScene(PEPESEG_FAKE_WORKER) {}

  Reply<v1::Job> Train(const v1::TrainSceneRequest& request) const {
    return Call(&JobStub::TrainScene, request);
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
    v1::WatchJobRequest request = Named{name};
    if (after.has_value()) request.set_after_sequence(*after);
    const auto stream = running.jobs->WatchJob(&context, request);
    Watched watched;
    v1::JobEvent event;
    while (stream->Read(&event)) watched.events.push_back(event);
    watched.status = stream->Finish();
    return watched;
  }
  Reply<v1::Job> Cancel(const std::string& name) const {
    return Call(&JobStub::CancelJob, Named{name});
  }
};

TEST_F(JobServiceTest, ListsEveryOptionWithTheDefaultsOfAPreset) {
  v1::ListTrainingOptionsRequest request;
  ASSERT_OK_AND_ASSIGN(const auto standard, Call(&JobStub::ListTrainingOptions, request));
  EXPECT_EQ(static_cast<size_t>(standard.options_size()), ListOptions(TrainingSettings()).size());
  request.set_preset(v1::TRAINING_PRESET_PREVIEW);
  ASSERT_OK_AND_ASSIGN(const auto preview, Call(&JobStub::ListTrainingOptions, request));
  ASSERT_EQ(preview.options_size(), standard.options_size());
  for (int i = 0; i < preview.options_size(); ++i) {
    const v1::TrainingOption& option = preview.options(i);
    EXPECT_NE(option.description(), "") << option.name();
    if (option.name() != "reconstruct.num_steps") continue;
    EXPECT_EQ(option.default_value(), "2000");
    EXPECT_EQ(standard.options(i).default_value(), "10000");
    EXPECT_EQ(option.range(), "[1, 10000000]");
  }
  request.set_preset(static_cast<v1::TrainingPreset>(9));
  EXPECT_ERROR(Call(&JobStub::ListTrainingOptions, request), grpc::INVALID_ARGUMENT,
               {.field = "preset", .message = "is not a preset"});
}

TEST_F(JobServiceTest, TakesTheSameOptionsInAnyOrderForARepeatedRequest) {
  auto request = Request("fine");
  request.set_request_id("5c2cf5a2-9be0-4f39-a0cb-5f0e9dd0b6c1");
  auto& advanced = *request.mutable_options()->mutable_advanced();
  for (int i = 0; i < 2; ++i) {
    advanced.clear();
    for (const char* name : {"features.smooth_until", "features.mask_share", "features.fine_first",
                             "reconstruct.dropout", "reconstruct.densify_until"}) {
      if (i == 0) advanced[name] = "0.25";
    }
    for (const char* name :
         {"reconstruct.densify_until", "reconstruct.dropout", "features.fine_first",
          "features.mask_share", "features.smooth_until"}) {
      advanced[name] = "0.25";
    }
    ASSERT_OK_AND_ASSIGN(const auto job, Train(request));
    EXPECT_EQ(job.name(), "jobs/j1");
  }
}

TEST_F(JobServiceTest, TrainsAndReportsEverything) {
  auto request = Request("fine");
  request.mutable_options()->mutable_reconstruct()->set_num_steps(77);
  ASSERT_OK_AND_ASSIGN(auto job, Train(request));
  EXPECT_EQ(job.name(), "jobs/j1");
  EXPECT_EQ(job.device(), "");  // not started yet
  EXPECT_EQ(job.effective_options().reconstruct().num_steps(), 77);
  EXPECT_EQ(job.effective_options().advanced().at("features.learning_rate"), "0.01");
  const Watched watched = Watch(job.name());
  ASSERT_OK(watched.status);
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
  TrainToTheEnd("shelf", "fine");
  ASSERT_OK_AND_ASSIGN(const auto spec,
                       JobFolder(running.options.data / "jobs" / "j1").ReadSpec(1));
  EXPECT_EQ(spec.memory_limit, WorkerMemory(running.options, 1));
  EXPECT_LT(spec.memory_limit, HostMemory().total_bytes);
}

TEST_F(JobServiceTest, ResumesAWatch) {
  const v1::Job job = TrainToTheEnd("shelf", "fine");
  const Watched all = Watch(job.name(), 0);
  ASSERT_OK(all.status);
  ASSERT_GE(all.events.size(), 3u) << "the snapshot, progress, the end";
  EXPECT_EQ(all.events[0].sequence(), 0);
  EXPECT_EQ(all.events[0].snapshot().state(), v1::JOB_STATE_SUCCEEDED);
  const v1::JobEvent& last = all.events.back();
  ASSERT_TRUE(last.has_state_changed()) << last.DebugString();
  EXPECT_EQ(last.state_changed().state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(last.state_changed().model(), "scenes/shelf/models/1");

  const Watched rest = Watch(job.name(), all.events[1].sequence());
  ASSERT_OK(rest.status);
  ASSERT_EQ(rest.events.size(), all.events.size() - 1);
  EXPECT_EQ(rest.events[1].sequence(), all.events[2].sequence());

  const Watched none = Watch(job.name(), last.sequence());
  EXPECT_OK(none.status);
  EXPECT_EQ(none.events.size(), 1u);
  EXPECT_ERROR(Watch(job.name(), last.sequence() + 1).status, grpc::OUT_OF_RANGE,
               {.limit = std::to_string(last.sequence())});
  EXPECT_ERROR(Watch(job.name(), -1).status, grpc::INVALID_ARGUMENT);
  EXPECT_ERROR(Watch("jobs/j99").status, grpc::NOT_FOUND);
  EXPECT_ERROR(Watch("jobs/../x").status, grpc::INVALID_ARGUMENT);
}

TEST_F(JobServiceTest, ReportsWhyAJobFailed) {
  ASSERT_OK_AND_ASSIGN(auto job, Train(Request("fail")));
  const Watched watched = Watch(job.name(), 0);
  ASSERT_OK(watched.status);
  const v1::Job failed = running.Await(job.name());
  EXPECT_EQ(failed.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(failed.error().code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(failed.error().reason(), "INVALID_ARGUMENT");
  EXPECT_NE(failed.error().message().find("images/bad.jpg"), std::string::npos);
  // A crash of the worker ends the job, not the server, and the next job runs.
  EXPECT_EQ(running.Await(running.Train("shelf", "crash").name()).state(), v1::JOB_STATE_FAILED);
  TrainToTheEnd("shelf", "fine");
}

TEST_F(JobServiceTest, RefusesInvalidTrainings) {
  const auto good = Request("fine");
  auto request = good;
  request.set_dataset("scenes/shelf/datasets/9");
  EXPECT_ERROR(Train(request), grpc::NOT_FOUND);
  request.set_dataset("scenes/other/datasets/1");
  EXPECT_ERROR(Train(request), grpc::INVALID_ARGUMENT, "dataset");
  request = good;
  request.set_scene("shelf");
  EXPECT_ERROR(Train(request), grpc::INVALID_ARGUMENT);
  request = good;
  request.mutable_options()->mutable_import()->set_image_scale(2);
  EXPECT_ERROR(Train(request), grpc::INVALID_ARGUMENT, {.message = "image_scale"});
  request = good;
  request.mutable_options()->mutable_import()->add_held_out_views("no_such.png");
  EXPECT_ERROR(Train(request), grpc::INVALID_ARGUMENT, {.message = "no_such.png"});
  EXPECT_EQ(running.CreateUpload("shelf", {{"x", "y"}}).name(), "scenes/shelf/uploads/2");
  request = good;
  request.set_dataset("scenes/shelf/datasets/2");
  EXPECT_ERROR(Train(request), grpc::FAILED_PRECONDITION);
}

TEST_F(JobServiceTest, RefusesACommandThatItDoesNotHave) {
  auto request = Request("fine");
  request.mutable_options()->mutable_priors()->set_masks(v1::PRIOR_MAKER_COMMAND);
  const grpc::Status refused = Train(request);
  EXPECT_ERROR(refused, grpc::FAILED_PRECONDITION, {.message = "options.priors.masks"});
  EXPECT_ERROR(refused, grpc::FAILED_PRECONDITION, {.message = "--priors-command"});
  running.options.workers.priors_command = "true";
  running.Restart();
  EXPECT_OK(Train(request));
}

TEST_F(JobServiceTest, RefusesSamThatItDoesNotHave) {
  auto request = Request("fine");
  for (const v1::PriorMaker maker : {v1::PRIOR_MAKER_SAM, v1::PRIOR_MAKER_SAM_AND_EMBEDDED}) {
    request.mutable_options()->mutable_priors()->set_masks(maker);
    EXPECT_ERROR(Train(request), grpc::FAILED_PRECONDITION, {.message = "deploy/sam.sh"});
  }
  testing::MakeFakeSam(running.folder / "sam");
  running.options.workers.sam = running.folder / "sam";
  running.Restart();
  EXPECT_OK(Train(request));
}

TEST_F(JobServiceTest, QueuesNothingForValidateOnly) {
  auto request = Request("fine");
  request.set_validate_only(true);
  request.mutable_options()->mutable_features()->set_num_steps(5);
  ASSERT_OK_AND_ASSIGN(auto job, Train(request));
  EXPECT_EQ(job.name(), "");
  EXPECT_EQ(job.effective_options().features().num_steps(), 5);
  EXPECT_EQ(Call(&JobStub::ListJobs, {})->jobs_size(), 0);
}

TEST_F(JobServiceTest, RunsOneTrainingOfASceneAtATime) {
  auto request = Request("hang");
  request.set_request_id("r1");
  const std::string first = Train(request)->name();
  EXPECT_EQ(Train(request)->name(), first) << "a retry";
  request.set_request_id("r2");
  EXPECT_ERROR(Train(request), grpc::ABORTED, {.resource = first});
  ASSERT_OK(Cancel(first));
  EXPECT_EQ(running.Await(first).state(), v1::JOB_STATE_CANCELLED);
  EXPECT_OK(Cancel(first)) << "of one that has ended";
  EXPECT_ERROR(Cancel("jobs/j99"), grpc::NOT_FOUND);
}

// One device, on which the first job runs for as long as the test.
TEST_F(JobServiceTest, SaysWhatAQueuedJobWaitsFor) {
  const std::string first = running.Train("shelf", "hang").name();
  ASSERT_TRUE(Eventually(
      [&] { return Call(&JobStub::GetJob, Named{first})->state() == v1::JOB_STATE_RUNNING; }));
  EXPECT_FALSE(Call(&JobStub::GetJob, Named{first})->has_wait());
  std::vector<std::string> waiting;
  for (const std::string scene : {"second", "third"}) {
    running.CreateScene(scene);
    v1::TrainSceneRequest request;
    request.set_scene("scenes/" + scene);
    request.set_dataset(running.UploadAndSeal(scene, {{"hang", "bytes"}}));
    ASSERT_OK_AND_ASSIGN(const auto job, Train(request));
    EXPECT_EQ(job.wait().reason(), v1::Job::Wait::REASON_DEVICE);
    EXPECT_EQ(job.wait().jobs_ahead(), static_cast<int>(waiting.size()));
    waiting.push_back(job.name());
  }
  for (int i = 0; i < 2; ++i) {
    const auto job = Call(&JobStub::GetJob, Named{waiting[i]});
    EXPECT_EQ(job->wait().reason(), v1::Job::Wait::REASON_DEVICE);
    EXPECT_EQ(job->wait().jobs_ahead(), i);
  }
  const auto listed = Call(&JobStub::ListJobs, v1::ListJobsRequest());
  for (const v1::Job& job : listed->jobs()) EXPECT_EQ(job.has_wait(), job.name() != first);
  ASSERT_OK(Cancel(waiting[0]));
  EXPECT_EQ(Call(&JobStub::GetJob, Named{waiting[1]})->wait().jobs_ahead(), 0);
  EXPECT_FALSE(Call(&JobStub::GetJob, Named{waiting[0]})->has_wait());
}

TEST_F(JobServiceTest, ListsByStateAndPage) {
  for (const char* file : {"fine", "fail", "fine"}) {
    running.Await(running.Train("shelf", file).name());
  }
  v1::ListJobsRequest request;
  request.set_state(v1::JOB_STATE_SUCCEEDED);
  request.set_page_size(1);
  std::vector<std::string> names;
  do {
    ASSERT_OK_AND_ASSIGN(const v1::ListJobsResponse list, Call(&JobStub::ListJobs, request));
    for (const v1::Job& one : list.jobs()) names.push_back(one.name());
    request.set_page_token(list.next_page_token());
  } while (!request.page_token().empty());
  EXPECT_EQ(names, (std::vector<std::string>{"jobs/j3", "jobs/j1"}));
}

TEST_F(JobServiceTest, FreesWatchersThatDisconnect) {
  const std::string name = running.Train("shelf", "hang").name();
  ASSERT_TRUE(Eventually([&] { return Call(&JobStub::GetJob, Named{name})->has_progress(); }));
  std::vector<std::thread> threads;
  threads.reserve(20);
  for (int i = 0; i < 20; ++i) {
    threads.emplace_back([&] {
      grpc::ClientContext context;
      const auto stream = running.jobs->WatchJob(&context, Named{name});
      v1::JobEvent event;
      EXPECT_TRUE(stream->Read(&event));
      context.TryCancel();
      while (stream->Read(&event)) {
      }
      EXPECT_ERROR(stream->Finish(), grpc::CANCELLED);
    });
  }
  for (std::thread& thread : threads) thread.join();
  // A watcher that stays sees the end.
  grpc::ClientContext context;
  const auto stream = running.jobs->WatchJob(&context, Named{name});
  v1::JobEvent event;
  ASSERT_TRUE(stream->Read(&event));
  ASSERT_OK(Cancel(name));
  ASSERT_TRUE(stream->Read(&event));
  while (stream->Read(&event)) {
  }
  ASSERT_OK(stream->Finish());
  EXPECT_EQ(event.state_changed().state(), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobServiceTest, EndsAWatchAtItsDeadline) {
  const std::string name = running.Train("shelf", "hang").name();
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::milliseconds(500));
  const auto stream = running.jobs->WatchJob(&context, Named{name});
  v1::JobEvent event;
  while (stream->Read(&event)) {
  }
  EXPECT_ERROR(stream->Finish(), grpc::DEADLINE_EXCEEDED);
}

}  // namespace
}  // namespace pepeseg
