// The memory of the server's process is what its ledger says: what became resident since the start
// is what is reserved for models, also after views of many sizes, which fragment a heap.
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <iostream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/residency/memory_budget.h"
#include "tests/server/pepesegd_process.h"
#include "tests/server/service_client.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

constexpr int kNumModels = 3;
// Of "wide.model" of model_worker.cc.
constexpr int kNumViews = 8;
constexpr ModelShape kShape = {20'000, 0, int64_t{784} * 588};
// What is not of models: code that runs for the first time, stacks of gRPC's threads and its
// buffers. Measured: 11 MiB.
constexpr int64_t kOtherBytes = int64_t{24} << 20;

std::string ModelName(int model) { return absl::StrCat("scenes/m", model, "/models/1"); }

// Returns a click on the red square, to be found in all views.
v1::SegmentViewsRequest ClickForAll(int model, int view) {
  v1::SegmentViewsRequest request;
  request.set_model(ModelName(model));
  request.mutable_prompt()->mutable_view()->set_view(absl::StrCat(view, ".jpg"));
  auto& point = *request.mutable_prompt()->mutable_points()->add_points();
  point.set_x(200);
  point.set_y(240);
  request.mutable_granularity()->set_scale_quantile(0.5);
  request.mutable_granularity()->set_threshold(0.75);
  request.mutable_targets()->set_group(v1::SegmentViewsRequest::Targets::GROUP_ALL);
  return request;
}

class ResidentSet : public ::testing::Test {
 protected:
  // Trains the models, none of which is in memory afterwards.
  ResidentSet() {
    testing::ServiceClient client(server_.channel());
    for (int model = 0; model < kNumModels; ++model) {
      const std::string scene = absl::StrCat("m", model);
      EXPECT_OK(client.CreateScene(scene));
      const auto dataset =
          client.Upload(scene, {{"wide.model", v1::FILE_KIND_IMAGE, absl::StrCat(model)}});
      EXPECT_OK(dataset);
      const auto job = client.Train(scene, *dataset, {});
      EXPECT_OK(job);
      EXPECT_EQ(client.WaitForJob(job->name())->state(), v1::JOB_STATE_SUCCEEDED);
    }
    start_ = MeasureResident();
  }

  // There is room for two models.
  static std::vector<std::string> Arguments(const testing::TempFolder& folder) {
    const MemoryBytes one = BytesOfModel(*MakeCpuBackend(1), kShape);
    return {absl::StrCat("--admin=unix:", (folder / "admin").string()), "--devices=cpu",
            absl::StrCat("--model-memory=", (one.host + one.device) * 5 / 2)};
  }

  int64_t MeasureResident() const {
    std::ifstream file(absl::StrCat("/proc/", server_.pid(), "/statm"));
    int64_t size = 0, resident = 0;
    file >> size >> resident;
    return resident * sysconf(_SC_PAGESIZE);
  }

  v1::ListResidentModelsResponse List() const {
    return *CallOver(admin_, &AdminStub::ListResidentModels, {});
  }
  int64_t ReservedBytes() const { return List().host().reserved_bytes(); }
  // Returns what is resident now and was not at the start.
  int64_t HeldBytes() const { return MeasureResident() - start_; }

  // Ask a model for a click in all views.
  void AskUnary(int model, int view) const {
    const auto answer =
        CallOver(server_.channel(), &SegmentationStub::SegmentViews, ClickForAll(model, view));
    EXPECT_OK(answer);
    EXPECT_EQ(answer->masks_size(), kNumViews);
  }

  void AskOnStream(int model, int view) const {
    grpc::ClientContext context;
    const auto stream = SegmentationStub(server_.channel()).StreamSegments(&context);
    v1::StreamSegmentsRequest request;
    *request.mutable_segment() = ClickForAll(model, view);
    ASSERT_TRUE(stream->Write(request));
    v1::StreamSegmentsResponse answer;
    ASSERT_TRUE(stream->Read(&answer));
    EXPECT_EQ(answer.segment().masks_size(), kNumViews) << answer.error().message();
    stream->WritesDone();
    EXPECT_OK(stream->Finish());
  }

  // Asks for a mask and renderings of the largest size for which memory is reserved, so that all
  // that is reserved is used.
  void AskLargest(const std::string& model) const {
    v1::SegmentViewsRequest request = ClickForAll(0, 0);
    request.set_model(model);
    request.clear_targets();
    auto& free = *request.mutable_prompt()->mutable_view()->mutable_free();
    v1::PinholeCamera& camera = *free.mutable_camera();
    camera.set_width(1920), camera.set_height(1080);
    camera.set_fx(1200), camera.set_fy(1200), camera.set_cx(960), camera.set_cy(540);
    free.mutable_cam_from_world()->mutable_rotation()->set_w(1);
    free.mutable_cam_from_world()->mutable_translation();
    auto& point = *request.mutable_prompt()->mutable_points()->mutable_points(0);
    point.set_x(700), point.set_y(540);
    EXPECT_OK(CallOver(server_.channel(), &SegmentationStub::SegmentViews, request));
    v1::RenderViewRequest render;
    render.set_model(request.model());
    *render.mutable_viewpoint() = request.prompt().view();
    for (const auto content :
         {v1::RenderViewRequest::CONTENT_COLOR, v1::RenderViewRequest::CONTENT_DEPTH}) {
      render.set_content(content);
      EXPECT_OK(CallOver(server_.channel(), &RenderStub::RenderView, render));
    }
  }

  const testing::TempFolder folder_;
  testing::PepesegdProcess server_{
      folder_ / "data",
      testing::PepesegdOptions{Arguments(folder_), {}, PEPESEG_MODEL_WORKER, "", false}};
  const std::shared_ptr<grpc::Channel> admin_ = grpc::CreateChannel(
      absl::StrCat("unix:", (folder_ / "admin").string()), grpc::InsecureChannelCredentials());
  int64_t start_ = 0;  // resident bytes without a model
};

TEST_F(ResidentSet, IsWhatTheLedgerReserves) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer's allocator keeps what is freed";
#endif
  // Two of the three models at a time, so that the third one is evicted.
  for (int round = 0; round < kNumModels; ++round) {
    std::vector<std::thread> clients;
    for (const int model : {round, (round + 1) % kNumModels}) {
      for (const int view : {0, 1}) {
        clients.emplace_back([this, model, view] { AskUnary(model, view); });
        clients.emplace_back([this, model, view] { AskOnStream(model, view + 2); });
      }
    }
    for (std::thread& client : clients) client.join();
    const int64_t reserved = ReservedBytes();
    EXPECT_LE(HeldBytes(), reserved + reserved / 10 + kOtherBytes) << "round " << round;
  }
  EXPECT_GE(List().num_evictions(), 2);
  EXPECT_EQ(List().models_size(), 2);

  const v1::ListResidentModelsResponse loaded = List();
  for (const v1::ResidentModel& model : loaded.models()) AskLargest(model.name());
  const int64_t reserved = ReservedBytes(), held = HeldBytes();
  std::cout << "reserved " << (reserved >> 20) << " MiB, held " << (held >> 20) << " MiB, "
            << (start_ >> 20) << " MiB at the start\n";
  EXPECT_NEAR(held, reserved, reserved / 10);

  for (const v1::ResidentModel& model : loaded.models()) {
    EXPECT_OK(CallOver(admin_, &AdminStub::UnloadModel, Named{model.name()}));
  }
  EXPECT_EQ(ReservedBytes(), 0);
  EXPECT_LE(HeldBytes(), kOtherBytes);
}

}  // namespace
}  // namespace pepeseg
