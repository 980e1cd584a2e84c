// A mixed load on two logical CPU devices: trainings of small scenes, some of them previews,
// clients that ask for segments, and a worker that is killed. Four trainings and four clients in
// `make test`, twenty and sixteen with PEPESEG_STRESS=full. PEPESEG_DEVICES=cuda:0,cuda:1 takes two
// GPUs in place of the CPU, and longer trainings.
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "pepeseg/v1/admin_service.grpc.pb.h"
#include "tests/server/pepesegd_process.h"
#include "tests/server/service_client.h"
#include "tests/testing/eventually.h"
#include "tests/testing/full_stress.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using testing::PepesegdProcess;
using testing::ServiceClient;

constexpr int kCheckpointSeconds = 1;

double Seconds(const google::protobuf::Timestamp& time) {
  return static_cast<double>(time.seconds()) + time.nanos() * 1e-9;
}

std::string Devices() {
  const char* devices = std::getenv("PEPESEG_DEVICES");
  return devices == nullptr ? "cpu:0,cpu:1" : devices;
}

v1::TrainingOptions Options(bool preview) {
  const int longer = absl::StartsWith(Devices(), "cuda") ? 8 : 1;
  v1::TrainingOptions options;
  if (preview) options.set_preset(v1::TRAINING_PRESET_PREVIEW);
  options.mutable_import()->set_image_scale(0.25);
  options.mutable_reconstruct()->set_num_steps(longer * (preview ? 200 : 1500));
  options.mutable_features()->set_num_steps(longer * (preview ? 100 : 300));
  (*options.mutable_advanced())["features.num_pixels"] = "300";
  (*options.mutable_advanced())["features.steps_per_chunk"] = "50";
  return options;
}

class DevicesLoadTest : public ::testing::Test {
 protected:
  DevicesLoadTest()
      : server_(folder_ / "data",
                std::vector<std::string>{
                    absl::StrCat("--devices=", Devices()), absl::StrCat("--admin=unix:", Socket()),
                    absl::StrCat("--checkpoint-seconds=", kCheckpointSeconds)}),
        client_(server_.channel()),
        files_(testing::ReadDataset(PEPESEG_TEST_DATA "/apc_shelf")) {}

  std::string Socket() const { return (folder_ / "admin").string(); }

  // Starts a training, and returns the name of the job.
  std::string Train(const std::string& scene, bool preview) {
    EXPECT_OK(client_.CreateScene(scene));
    const auto dataset = client_.Upload(scene, files_);
    EXPECT_OK(dataset);
    const auto job = client_.Train(scene, dataset.value_or(""), Options(preview));
    EXPECT_OK(job);
    return job.ok() ? job->name() : "";
  }

  v1::ServerStatus Status() const {
    const auto stub = v1::AdminService::NewStub(
        grpc::CreateChannel("unix:" + Socket(), grpc::InsecureChannelCredentials()));
    grpc::ClientContext context;
    v1::ServerStatus status;
    EXPECT_OK(stub->GetServerStatus(&context, {}, &status));
    return status;
  }

  // Returns the time in which jobs ran on both devices, seconds.
  double JobSeconds() const {
    const v1::ServerStatus status = Status();
    double sum = 0;
    for (const auto& device : status.devices()) {
      sum += static_cast<double>(device.job_time().seconds()) + device.job_time().nanos() * 1e-9;
    }
    return sum;
  }

  // Kills the worker of a job that has saved a checkpoint. Returns the time, seconds since 1970.
  double KillWorkerOf(const std::string& job) {
    const std::filesystem::path folder = folder_ / "data" / job;
    const auto saved = [&] {
      std::error_code vanished;
      using Iterator = std::filesystem::recursive_directory_iterator;
      for (Iterator it(folder, vanished), end; it != end; it.increment(vanished)) {
        if (it->path().extension() == ".ckpt") return true;
      }
      return false;
    };
    EXPECT_TRUE(testing::Eventually(saved, absl::Seconds(120)));
    const pid_t worker = testing::FindProcess(absl::StrCat("--job=", folder.string()));
    EXPECT_NE(worker, 0);
    if (worker != 0) kill(worker, SIGKILL);
    return absl::ToDoubleSeconds(absl::Now() - absl::UnixEpoch());
  }

  const testing::TempFolder folder_;
  PepesegdProcess server_;
  ServiceClient client_;
  const std::vector<testing::ClientFile> files_;
};

// Returns how much work an attempt has lost, seconds: from when the step at which the next attempt
// resumed was reached first, to the kill.
double LostSeconds(const std::vector<v1::JobEvent>& events, double killed) {
  int num_starts = 0;
  std::vector<const v1::JobEvent*> before;
  for (const v1::JobEvent& event : events) {
    num_starts += event.state_changed().state() == v1::JOB_STATE_RUNNING ? 1 : 0;
    if (!event.has_progress()) continue;
    if (num_starts == 1) before.push_back(&event);
    if (num_starts < 2 || event.progress().stage() != v1::JOB_STAGE_RECONSTRUCT) continue;
    for (const v1::JobEvent* earlier : before) {
      const bool reached = earlier->progress().stage() == event.progress().stage() &&
                           earlier->progress().step() >= event.progress().step();
      if (reached) return killed - Seconds(earlier->time());
    }
    return 0;
  }
  ADD_FAILURE() << "the job was not resumed";
  return 0;
}

// Clients that ask for segments of one view, one after another with short pauses, until stopped.
class AskingClients {
 public:
  AskingClients(const PepesegdProcess& server, const v1::SegmentViewsRequest& request, int count) {
    for (int i = 0; i < count; ++i) {
      threads_.emplace_back([this, &server, request] {
        ServiceClient client(server.channel());
        while (!stop_) {
          client.Segment(request).ok() ? ++num_answers_ : ++num_errors_;
          absl::SleepFor(absl::Milliseconds(100));
        }
      });
    }
  }
  ~AskingClients() { Stop(); }
  void Stop() {
    stop_ = true;
    for (std::thread& thread : threads_) thread.join();
    threads_.clear();
  }
  int64_t num_answers() const { return num_answers_; }
  int64_t num_errors() const { return num_errors_; }

 private:
  std::atomic<bool> stop_ = false;
  std::atomic<int64_t> num_answers_ = 0, num_errors_ = 0;
  std::vector<std::thread> threads_;
};

TEST_F(DevicesLoadTest, UsesBothDevices) {
  const int num_jobs = testing::FullStress() ? 20 : 4;
  const std::string first = Train("first", /*preview=*/true);
  ASSERT_OK(client_.WaitForJob(first));
  v1::SegmentViewsRequest request;
  request.set_model("scenes/first/models/1");
  const auto views = client_.ListViews(request.model());
  ASSERT_OK(views);
  request.mutable_prompt()->mutable_view()->set_view(views->front().view());
  auto& point = *request.mutable_prompt()->mutable_points()->add_points();
  point.set_x(40);
  point.set_y(30);
  ASSERT_OK(client_.Segment(request));
  AskingClients clients(server_, request, testing::FullStress() ? 16 : 4);

  const double busy_before = JobSeconds();
  const absl::Time begin = absl::Now();
  std::vector<std::string> jobs;
  for (int i = 0; i < num_jobs; ++i) {
    jobs.push_back(Train(absl::StrCat("s", i), /*preview=*/i % 4 == 3));
  }
  const double killed = KillWorkerOf(jobs[0]);
  absl::Duration previews, others;
  for (int i = 0; i < num_jobs; ++i) {
    auto job = client_.WaitForJob(jobs[i]);
    // Its deadline is for a job that runs at once; here up to twenty wait for two devices.
    for (int k = 0; k < 10 && absl::IsDeadlineExceeded(job.status()); ++k) {
      job = client_.WaitForJob(jobs[i]);
    }
    ASSERT_OK(job);
    EXPECT_EQ(job->state(), v1::JOB_STATE_SUCCEEDED) << job->error().message();
    const absl::Duration taken =
        absl::Seconds(Seconds(job->end_time()) - Seconds(job->create_time()));
    (i % 4 == 3 ? previews : others) = std::max(i % 4 == 3 ? previews : others, taken);
  }
  const double wall = absl::ToDoubleSeconds(absl::Now() - begin);
  const double use = (JobSeconds() - busy_before) / (2 * wall);
  clients.Stop();
  const auto events = client_.Watch(jobs[0]);
  ASSERT_OK(events);
  const double lost = LostSeconds(*events, killed);
  std::cout << num_jobs << " jobs in " << wall << " s, use of both devices " << 100 * use
            << " %; longest wait and run: previews " << absl::FormatDuration(previews)
            << ", others " << absl::FormatDuration(others) << "; " << clients.num_answers()
            << " answers, " << clients.num_errors() << " errors; a killed worker cost " << lost
            << " s\n";
  EXPECT_EQ(clients.num_errors(), 0);
  EXPECT_GT(clients.num_answers(), 10);
  // The last job runs alone, which counts for more among few jobs.
  EXPECT_GE(use, testing::FullStress() ? 0.9 : 0.6);
  // A kill costs the work since the last checkpoint. Saving one takes time on a busy machine, and a
  // machine that also runs other tests may stand still for seconds.
  EXPECT_LE(lost, testing::FullStress() ? 3 * kCheckpointSeconds + 2 : 30);
  EXPECT_LT(previews, others);
}

}  // namespace
}  // namespace pepeseg
