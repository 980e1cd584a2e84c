#include "tests/system/gateway/steady_load.h"

#include <grpcpp/alarm.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "pepeseg/v1/errors.pb.h"
#include "server/store/error_detail.h"
#include "tests/system/stress/load_calls.h"
#include "tests/testing/eventually.h"

namespace pepeseg::testing {

namespace {

// Returns the pause before the second call: the one that the server asks for, or a quarter of a
// second if the server was lost.
std::chrono::milliseconds PauseAfter(const grpc::Status& status) {
  v1::Status details;
  details.ParseFromString(status.error_details());
  const std::optional<absl::Duration> retry_after = UnpackDetail(details.details()).retry_after;
  if (retry_after) return absl::ToChronoMilliseconds(*retry_after);
  return std::chrono::milliseconds(250);
}

}  // namespace

struct SteadyLoad::Call {
  v1::SegmentationService::Stub* stub;
  v1::SegmentViewsRequest request;
  std::string scene;
  bool is_second = false;
  absl::Time start = absl::Now();
  grpc::Alarm pause;  // pause before the second call
  std::unique_ptr<grpc::ClientContext> context;
  v1::SegmentViewsResponse response;
};

v1::SegmentViewsRequest SteadyLoad::SmallQuery(const std::string& scene) {
  v1::SegmentViewsRequest request = ::pepeseg::SmallQuery();
  request.set_model(absl::StrCat("scenes/", scene, "/models/live"));
  return request;
}

SteadyLoad::SteadyLoad(std::vector<std::shared_ptr<grpc::Channel>> channels, int num_scenes,
                       double per_second) {
  for (const auto& channel : channels) {
    stubs_.push_back(v1::SegmentationService::NewStub(channel));
  }
  const absl::Duration pause = absl::Seconds(1) / per_second;
  thread_ = std::thread([this, num_scenes, pause] { Run(num_scenes, pause); });
}

void SteadyLoad::Run(int num_scenes, absl::Duration pause) {
  const absl::Time start = absl::Now();
  for (int64_t i = 0; !stopping_; ++i) {
    absl::SleepFor(start + static_cast<double>(i) * pause - absl::Now());
    auto call = std::make_shared<Call>();
    call->stub = stubs_[static_cast<size_t>(i) % stubs_.size()].get();
    call->scene = SceneId(static_cast<int>(i % num_scenes));
    call->request = SmallQuery(call->scene);
    ++num_open_;
    Start(std::move(call));
  }
  EXPECT_TRUE(testing::Eventually([this] { return num_open_ == 0; }, absl::Minutes(5)));
  const std::lock_guard lock(mutex_);
  report_.took = absl::Now() - start;
}

void SteadyLoad::Start(std::shared_ptr<Call> call) {
  call->context = std::make_unique<grpc::ClientContext>();
  call->context->AddMetadata("x-scene", call->scene);
  call->context->set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(20));
  Call& started = *call;
  started.stub->async()->SegmentViews(
      started.context.get(), &started.request, &started.response,
      [this, call = std::move(call)](const grpc::Status& status) { Answered(call, status); });
}

void SteadyLoad::Answered(const std::shared_ptr<Call>& call, const grpc::Status& status) {
  bool again = false;
  {
    const std::lock_guard lock(mutex_);
    if (!status.ok()) {
      ++report_.reasons[absl::StrCat(status.error_code(), " ", status.error_message())];
      again = !call->is_second;
      ++(again ? report_.num_retried : report_.num_failed);
    }
    if (!again) {
      ++report_.num_calls;
      durations_.push_back(absl::Now() - call->start);
    }
  }
  if (!again) {
    --num_open_;
    return;
  }
  auto second = std::make_shared<Call>();
  second->stub = call->stub;
  second->request = call->request;
  second->scene = call->scene;
  second->is_second = true;
  second->start = call->start;
  Call& waiting = *second;
  waiting.pause.Set(std::chrono::system_clock::now() + PauseAfter(status),
                    [this, second](bool) { Start(second); });
}

SteadyLoadReport SteadyLoad::Stop() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
  const std::lock_guard lock(mutex_);
  std::sort(durations_.begin(), durations_.end());
  if (!durations_.empty()) {
    report_.p50 = durations_[durations_.size() / 2];
    report_.p99 = durations_[durations_.size() * 99 / 100];
    report_.longest = durations_.back();
  }
  return report_;
}

}  // namespace pepeseg::testing
