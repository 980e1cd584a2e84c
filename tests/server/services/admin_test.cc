// Models in memory, as an operator sees them.
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/residency/memory_budget.h"
#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

// The model that model_worker.cc makes.
constexpr ModelShape kShape = {20'000, 0, int64_t{96} * 64};

// Returns the bytes of one model on the CPU, where host and device have one memory.
int64_t BytesOfOne() {
  const MemoryBytes bytes = BytesOfModel(*MakeCpuBackend(1), kShape);
  return bytes.host + bytes.device;
}

// A budget for two models but not for three.
ServerOptions RoomForTwo() {
  ServerOptions options;
  options.admin = "127.0.0.1:0";
  options.model_bytes = BytesOfOne() * 5 / 2;
  return options;
}

struct AdminTest : ServiceTest {
  AdminTest() : ServiceTest(PEPESEG_MODEL_WORKER, RoomForTwo()) {
    for (const char* scene : {"a", "b", "c"}) {
      running.CreateScene(scene);
      TrainToTheEnd(scene, "file");
    }
  }
  static std::string NameOf(const std::string& scene) {
    return absl::StrCat("scenes/", scene, "/models/1");
  }
  Reply<v1::ResidentModel> Load(const std::string& name) const {
    return Call(&AdminStub::LoadModel, Named{name});
  }
  grpc::Status Unload(const std::string& name) {
    return Call(&AdminStub::UnloadModel, Named{name});
  }
  Reply<v1::ResidentModel> Pin(const std::string& name) const {
    return Call(&AdminStub::PinModel, Named{name});
  }
  Reply<v1::ResidentModel> Unpin(const std::string& name) const {
    return Call(&AdminStub::UnpinModel, Named{name});
  }
  v1::ListResidentModelsResponse List() const { return *Call(&AdminStub::ListResidentModels, {}); }
  std::vector<std::string> ListNames() {
    const v1::ListResidentModelsResponse list = List();
    std::vector<std::string> names;
    names.reserve(list.models_size());
    for (const v1::ResidentModel& resident : list.models()) names.push_back(resident.name());
    std::sort(names.begin(), names.end());
    return names;
  }
  grpc::Status Ask(const std::string& scene) {
    auto request = Click<v1::SegmentViewsRequest>(30);
    request.set_model(absl::StrCat("scenes/", scene, "/models/live"));
    request.mutable_granularity()->set_scale_quantile(0.5);
    request.mutable_granularity()->set_threshold(0.75);
    return Call(&SegmentationStub::SegmentViews, request);
  }
};

TEST_F(AdminTest, LoadsAndUnloads) {
  EXPECT_EQ(List().models_size(), 0);
  ASSERT_OK_AND_ASSIGN(auto model, Load("scenes/a/models/live"));
  EXPECT_EQ(model.name(), NameOf("a"));
  EXPECT_EQ(model.host_bytes() + model.device_bytes(), BytesOfOne());
  EXPECT_FALSE(model.pinned());
  EXPECT_EQ(model.queries_in_flight(), 0);
  EXPECT_TRUE(model.has_last_use_time());
  const v1::ListResidentModelsResponse list = List();
  ASSERT_EQ(list.models_size(), 1);
  EXPECT_EQ(list.models(0).DebugString(), model.DebugString());
  EXPECT_EQ(list.host().reserved_bytes(), BytesOfOne());
  EXPECT_EQ(list.host().limit_bytes(), RoomForTwo().model_bytes - RoomForTwo().model_bytes / 20);
  EXPECT_FALSE(list.has_device());
  EXPECT_GT(list.device_bytes_in_use(), 20'000 * (14 + 32) * 4);
  ASSERT_OK(Unload(NameOf("a")));
  EXPECT_EQ(List().models_size(), 0);
  EXPECT_EQ(List().host().reserved_bytes(), 0);
  EXPECT_EQ(List().device_bytes_in_use(), 0);
  EXPECT_ERROR(Unload(NameOf("a")), grpc::NOT_FOUND, {.reason = "NOT_RESIDENT"});
  EXPECT_ERROR(Load("scenes/a/models/7"), grpc::NOT_FOUND);
  EXPECT_ERROR(Load("nonsense"), grpc::INVALID_ARGUMENT);
}

TEST_F(AdminTest, ReportsMapsThatQueriesLeave) {
  ASSERT_OK(Ask("a"));
  v1::ListResidentModelsResponse list = List();
  ASSERT_EQ(list.models_size(), 1);
  EXPECT_EQ(list.models(0).cached_maps(), 1);
  EXPECT_EQ(list.models(0).num_renders(), 1);
  ASSERT_OK(Ask("a"));
  list = List();
  EXPECT_EQ(list.models(0).num_renders(), 1);
  EXPECT_EQ(list.num_loads(), 1);
}

TEST_F(AdminTest, EvictsTheLeastRecentlyUsedUnlessPinned) {
  EXPECT_TRUE(Pin(NameOf("a"))->pinned());
  ASSERT_OK(Ask("b"));
  ASSERT_OK(Ask("c"));
  EXPECT_EQ(ListNames(), (std::vector<std::string>{NameOf("a"), NameOf("c")}));
  EXPECT_EQ(List().num_evictions(), 1);
  ASSERT_OK(Pin(NameOf("c")));
  const grpc::Status full = Ask("b");
  EXPECT_ERROR(full, grpc::RESOURCE_EXHAUSTED,
               {.reason = "DOES_NOT_FIT", .message = "scenes/b/models/1: needs"});
  EXPECT_THAT(DetailOf(full).value(), ::testing::HasSubstr(absl::StrCat(BytesOfOne(), " bytes")));
  ASSERT_OK(Unpin(NameOf("a")));
  EXPECT_OK(Ask("b"));
  EXPECT_EQ(ListNames(), (std::vector<std::string>{NameOf("b"), NameOf("c")}));
}

// Exports of a segment, whose readers take no more than the header.
struct UnreadExports : AdminTest {
  grpc::Status Begin(const std::string& scene) {
    v1::ExportGaussiansRequest request;
    request.set_model(NameOf(scene));
    request.mutable_subset()->mutable_segment()->set_level(1);
    request.mutable_subset()->mutable_segment()->set_id(2);
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    readers.push_back(running.renders->ExportGaussians(contexts.back().get(), request));
    v1::ExportGaussiansResponse part;
    if (readers.back()->Read(&part)) return grpc::Status::OK;
    const grpc::Status status = readers.back()->Finish();
    readers.pop_back();
    return status;
  }
  void ReadToTheEnd() {
    v1::ExportGaussiansResponse part;
    for (const auto& reader : readers) {
      while (reader->Read(&part)) {
      }
      EXPECT_OK(reader->Finish());
    }
    readers.clear();
  }
  ~UnreadExports() override { ReadToTheEnd(); }
  static void ExpectPutOff(const grpc::Status& status) {
    EXPECT_ERROR(status, grpc::UNAVAILABLE, {.reason = "NO_ROOM_NOW"});
    EXPECT_GT(DetailOf(status).retry_after().seconds(), 0);
    EXPECT_NE(DetailOf(status).value(), "");
    EXPECT_NE(DetailOf(status).limit(), "");
  }

  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::ExportGaussiansResponse>>> readers;
};

TEST_F(UnreadExports, DelayAColdModelUntilTheyAreRead) {
  for (const char* scene : {"a", "b"}) ASSERT_OK(Begin(scene));
  const v1::ListResidentModelsResponse list = List();
  ASSERT_EQ(list.models_size(), 2);
  for (const v1::ResidentModel& resident : list.models()) {
    ASSERT_EQ(resident.queries_in_flight(), 1) << resident.name();
  }
  const grpc::Status put_off = Ask("c");
  ExpectPutOff(put_off);
  EXPECT_THAT(put_off.error_message(), ::testing::HasSubstr("scenes/c/models/1: needs"));
  EXPECT_EQ(List().num_evictions(), 0);
  EXPECT_OK(Ask("a")) << "what is resident is asked all the same";
  ReadToTheEnd();
  // The exports end a little after their readers.
  EXPECT_TRUE(Eventually([this] { return Ask("c").ok(); }, absl::Seconds(10)));
}

TEST_F(UnreadExports, DelayAnotherExportThatDoesNotFit) {
  grpc::Status status;
  while (readers.size() < 1000 && (status = Begin("a")).ok()) {
  }
  EXPECT_GT(readers.size(), 1);
  ExpectPutOff(status);
  ReadToTheEnd();
  EXPECT_TRUE(Eventually([this] { return Begin("a").ok(); }, absl::Seconds(10)));
}

TEST_F(AdminTest, KeepsPinnedModelsUntilTheirSceneIsDeleted) {
  ASSERT_OK(Pin("scenes/a/models/live"));
  EXPECT_ERROR(Unload(NameOf("a")), grpc::FAILED_PRECONDITION, {.reason = "PINNED"});
  EXPECT_OK(Ask("a"));
  EXPECT_ERROR(Unpin(NameOf("b")), grpc::NOT_FOUND) << "not in memory";
  ASSERT_OK(Call(&SceneStub::DeleteScene, Named{"scenes/a"}));
  EXPECT_EQ(List().models_size(), 0);
}

TEST_F(AdminTest, UnpinsAModelSoThatItMayBeUnloaded) {
  ASSERT_OK_AND_ASSIGN(auto model, Pin("scenes/a/models/live"));
  EXPECT_TRUE(model.pinned());
  EXPECT_EQ(model.queries_in_flight(), 0);
  ASSERT_OK_AND_ASSIGN(model, Unpin(NameOf("a")));
  EXPECT_EQ(model.name(), NameOf("a"));
  EXPECT_FALSE(model.pinned());
  EXPECT_OK(Unpin(NameOf("a"))) << "again";
  EXPECT_OK(Unload(NameOf("a")));
  EXPECT_ERROR(Unpin(NameOf("a")), grpc::NOT_FOUND,
               {.reason = "NOT_RESIDENT", .resource = NameOf("a")});
}

TEST_F(AdminTest, IsServedOnItsOwnListenerOnly) {
  EXPECT_ERROR(CallOver(running.channel, &AdminStub::ListResidentModels, {}), grpc::UNIMPLEMENTED);
  EXPECT_NE(running.server->admin_port(), 0);
  EXPECT_NE(running.server->admin_port(), running.server->port());
  const auto socket = grpc::CreateChannel(absl::StrCat("127.0.0.1:", running.server->admin_port()),
                                          grpc::InsecureChannelCredentials());
  EXPECT_OK(CallOver(socket, &AdminStub::ListResidentModels, {}));
  EXPECT_ERROR(CallOver(socket, &SceneStub::ListScenes, {}), grpc::UNIMPLEMENTED);

  running.options.admin = "unix:" + (running.folder / "admin.sock").string();
  running.Restart();
  const auto unix_socket =
      grpc::CreateChannel(running.options.admin, grpc::InsecureChannelCredentials());
  EXPECT_OK(CallOver(unix_socket, &AdminStub::ListResidentModels, {}));

  running.options.admin.clear();
  running.Restart();
  EXPECT_EQ(running.server->InProcessAdminChannel(), nullptr);
  EXPECT_EQ(running.server->admin_port(), 0);
}

TEST(AdminListener, RefusesOtherMachinesByDefault) {
  const testing::TempFolder folder;
  ServerOptions options;
  options.data = folder.path();
  options.worker = PEPESEG_MODEL_WORKER;
  options.devices = "cpu";
  options.admin = "0.0.0.0:0";
  EXPECT_STATUS(Server::Start(options), absl::StatusCode::kFailedPrecondition,
                "listening on 0.0.0.0:0");
  options.insecure = true;
  EXPECT_OK(Server::Start(options));
}

}  // namespace
}  // namespace pepeseg
