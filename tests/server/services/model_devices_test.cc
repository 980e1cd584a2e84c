// Models and jobs of a server with two logical CPU devices.
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/residency/memory_budget.h"
#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

// The model that model_worker.cc makes.
constexpr ModelShape kSquaresShape = {20'000, 0, int64_t{96} * 64};

// Each of two devices has room for one model, and not for two.
ServerOptions RoomForOneOnEach() {
  const MemoryBytes bytes = BytesOfModel(*MakeCpuBackend(1), kSquaresShape);
  ServerOptions options;
  options.admin = "127.0.0.1:0";
  options.model_bytes = 2 * (bytes.host + bytes.device) * 3 / 2;
  return options;
}

struct ModelsOnTwoDevices : ServiceTest {
  ModelsOnTwoDevices() : ServiceTest(PEPESEG_MODEL_WORKER, RoomForOneOnEach()) {
    running.options.devices = "cpu:0,cpu:1";
    running.Restart();
    for (const char* scene : {"a", "b", "c"}) {
      running.CreateScene(scene);
      TrainToTheEnd(scene, "file");
    }
  }
  static std::string NameOf(const std::string& scene) {
    return absl::StrCat("scenes/", scene, "/models/1");
  }
  grpc::Status Ask(const std::string& scene) {
    auto request = Click<v1::SegmentViewsRequest>(30);
    request.set_model(NameOf(scene));
    request.mutable_granularity()->set_scale_quantile(0.5);
    request.mutable_granularity()->set_threshold(0.75);
    return Call(&SegmentationStub::SegmentViews, request);
  }
  // Returns the device of each model in memory, by the model's name.
  std::map<std::string, std::string> Placed() const {
    std::map<std::string, std::string> placed;
    const auto list = Call(&AdminStub::ListResidentModels, {});
    for (const v1::ResidentModel& model : list->models()) placed[model.name()] = model.device();
    return placed;
  }
};

TEST_F(ModelsOnTwoDevices, GoWhereMemoryIsFreeAndStay) {
  ASSERT_OK(Ask("a"));
  ASSERT_OK(Ask("b"));
  const auto placed = Placed();
  ASSERT_EQ(placed.size(), 2u);
  EXPECT_NE(placed.at(NameOf("a")), placed.at(NameOf("b")));
  ASSERT_OK(Ask("a"));
  EXPECT_EQ(Placed(), placed);
  const auto list = Call(&AdminStub::ListResidentModels, {});
  EXPECT_EQ(list->num_loads(), 2);
  EXPECT_FALSE(list->has_device());
}

TEST_F(ModelsOnTwoDevices, TakeTheNextDeviceIfOneHasNoRoom) {
  // Both take the same memory, so the first device is tried first for each model that is loaded.
  ASSERT_OK(Call(&AdminStub::PinModel, Named{NameOf("a")}));
  const std::string pinned = Placed().at(NameOf("a"));
  for (const char* scene : {"b", "c", "b"}) {
    ASSERT_OK(Ask(scene)) << scene;
    const auto placed = Placed();
    ASSERT_EQ(placed.size(), 2u) << scene;
    EXPECT_EQ(placed.at(NameOf("a")), pinned);
    EXPECT_NE(placed.at(NameOf(scene)), pinned);
  }
  ASSERT_OK(Call(&AdminStub::PinModel, Named{NameOf("b")}));
  EXPECT_ERROR(Ask("c"), grpc::RESOURCE_EXHAUSTED, {.reason = "DOES_NOT_FIT"});
  ASSERT_OK(Call(&AdminStub::UnpinModel, Named{NameOf("b")}));
  ASSERT_OK(Call(&AdminStub::UnloadModel, Named{NameOf("b")}));
  EXPECT_EQ(Placed().size(), 1u);
  EXPECT_ERROR(Call(&AdminStub::UnloadModel, Named{NameOf("b")}), grpc::NOT_FOUND,
               {.reason = "NOT_RESIDENT"});
}

TEST_F(ModelsOnTwoDevices, AreLoadedOnceForManyCallers) {
  std::vector<std::thread> callers;
  for (int i = 0; i < 8; ++i) {
    callers.emplace_back([this] { EXPECT_OK(Call(&AdminStub::LoadModel, Named{NameOf("c")})); });
  }
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(Placed().size(), 1u);
  EXPECT_EQ(Call(&AdminStub::ListResidentModels, {})->num_loads(), 1);
}

TEST_F(ModelsOnTwoDevices, AreNamedInTheStatus) {
  ASSERT_OK(Ask("a"));
  const auto status = Call(&AdminStub::GetServerStatus, {});
  ASSERT_EQ(status->devices_size(), 2);
  EXPECT_EQ(status->devices(0).id(), "cpu:0");
  EXPECT_EQ(status->devices(1).id(), "cpu:1");
  EXPECT_EQ(status->device(),
            absl::StrCat(status->devices(0).name(), ", ", status->devices(1).name()));
  EXPECT_EQ(status->devices(0).num_models() + status->devices(1).num_models(), 1);
  double job_seconds = 0;
  for (const auto& device : status->devices()) {
    EXPECT_EQ(device.job(), "");
    EXPECT_GT(device.model_limit_bytes(), 0);
    job_seconds +=
        static_cast<double>(device.job_time().seconds()) + device.job_time().nanos() * 1e-9;
  }
  EXPECT_GT(job_seconds, 0);
}

// A project's quota counts its models on all devices.
TEST_F(ModelsOnTwoDevices, ShareTheQuotaOfTheirProject) {
  const MemoryBytes bytes = BytesOfModel(*MakeCpuBackend(1), kSquaresShape);
  running.options.quota.resident_bytes = (bytes.host + bytes.device) * 3 / 2;
  running.Restart();
  ASSERT_OK(Ask("a"));
  ASSERT_OK(Ask("b"));
  EXPECT_EQ(Placed().size(), 1u);
}

}  // namespace
}  // namespace pepeseg
