// Models in memory, as an operator sees them.
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/residency/model_bytes.h"
#include "tests/server/running_server.h"

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

class AdminTest : public ::testing::Test {
 protected:
  AdminTest() {
    for (const char* scene : {"a", "b", "c"}) {
      running.CreateScene(scene);
      const v1::Job job = running.Await(running.Train(scene, "file").name());
      EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.DebugString();
    }
  }
  static std::string NameOf(const std::string& scene) {
    return absl::StrCat("scenes/", scene, "/models/1");
  }
  grpc::Status Load(const std::string& name) {
    grpc::ClientContext context;
    v1::LoadModelRequest request;
    request.set_name(name);
    return running.admin->LoadModel(&context, request, &model);
  }
  grpc::Status Unload(const std::string& name) {
    grpc::ClientContext context;
    v1::UnloadModelRequest request;
    request.set_name(name);
    google::protobuf::Empty empty;
    return running.admin->UnloadModel(&context, request, &empty);
  }
  grpc::Status Pin(const std::string& name) {
    grpc::ClientContext context;
    v1::PinModelRequest request;
    request.set_name(name);
    return running.admin->PinModel(&context, request, &model);
  }
  grpc::Status Unpin(const std::string& name) {
    grpc::ClientContext context;
    v1::UnpinModelRequest request;
    request.set_name(name);
    return running.admin->UnpinModel(&context, request, &model);
  }
  v1::ListResidentModelsResponse List() {
    grpc::ClientContext context;
    v1::ListResidentModelsResponse response;
    const grpc::Status status = running.admin->ListResidentModels(&context, {}, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response;
  }
  std::vector<std::string> ListNames() {
    const v1::ListResidentModelsResponse list = List();
    std::vector<std::string> names;
    names.reserve(list.models_size());
    for (const v1::ResidentModel& resident : list.models()) names.push_back(resident.name());
    std::sort(names.begin(), names.end());
    return names;
  }
  grpc::Status Ask(const std::string& scene) {
    grpc::ClientContext context;
    v1::SegmentViewsRequest request;
    request.set_model(absl::StrCat("scenes/", scene, "/models/live"));
    request.mutable_prompt()->mutable_view()->set_view("middle.jpg");
    auto& point = *request.mutable_prompt()->mutable_points()->add_points();
    point.set_x(30);
    point.set_y(32);
    request.mutable_granularity()->set_scale_quantile(0.5);
    request.mutable_granularity()->set_threshold(0.75);
    v1::SegmentViewsResponse response;
    return running.segmentation->SegmentViews(&context, request, &response);
  }

  RunningServer running{PEPESEG_MODEL_WORKER, RoomForTwo()};
  v1::ResidentModel model;
};

TEST_F(AdminTest, LoadsAndUnloads) {
  EXPECT_EQ(List().models_size(), 0);
  ASSERT_TRUE(Load("scenes/a/models/live").ok());
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
  ASSERT_TRUE(Unload(NameOf("a")).ok());
  EXPECT_EQ(List().models_size(), 0);
  EXPECT_EQ(List().host().reserved_bytes(), 0);
  EXPECT_EQ(List().device_bytes_in_use(), 0);
  const grpc::Status again = Unload(NameOf("a"));
  EXPECT_EQ(again.error_code(), grpc::NOT_FOUND);
  EXPECT_EQ(DetailOf(again).reason(), "NOT_RESIDENT");
  EXPECT_EQ(Load("scenes/a/models/7").error_code(), grpc::NOT_FOUND);
  EXPECT_EQ(Load("nonsense").error_code(), grpc::INVALID_ARGUMENT);
}

TEST_F(AdminTest, ReportsMapsThatQueriesLeave) {
  ASSERT_TRUE(Ask("a").ok());
  v1::ListResidentModelsResponse list = List();
  ASSERT_EQ(list.models_size(), 1);
  EXPECT_EQ(list.models(0).cached_maps(), 1);
  EXPECT_EQ(list.models(0).num_renders(), 1);
  ASSERT_TRUE(Ask("a").ok());
  list = List();
  EXPECT_EQ(list.models(0).num_renders(), 1);
  EXPECT_EQ(list.num_loads(), 1);
}

TEST_F(AdminTest, EvictsTheLeastRecentlyUsedUnlessPinned) {
  ASSERT_TRUE(Pin(NameOf("a")).ok());
  EXPECT_TRUE(model.pinned());
  ASSERT_TRUE(Ask("b").ok());
  ASSERT_TRUE(Ask("c").ok());
  EXPECT_EQ(ListNames(), (std::vector<std::string>{NameOf("a"), NameOf("c")}));
  EXPECT_EQ(List().num_evictions(), 1);
  ASSERT_TRUE(Pin(NameOf("c")).ok());
  const grpc::Status full = Ask("b");
  EXPECT_EQ(full.error_code(), grpc::RESOURCE_EXHAUSTED);
  EXPECT_EQ(DetailOf(full).reason(), "DOES_NOT_FIT");
  const MemoryBytes need = BytesOfModel(*MakeCpuBackend(1), kShape);
  EXPECT_NE(DetailOf(full).value().find(absl::StrCat(need.host + need.device, " bytes")),
            std::string::npos)
      << DetailOf(full).value();
  EXPECT_NE(full.error_message().find("scenes/b/models/1: needs"), std::string::npos)
      << full.error_message();
  ASSERT_TRUE(Unpin(NameOf("a")).ok());
  EXPECT_TRUE(Ask("b").ok());
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
      EXPECT_TRUE(reader->Finish().ok());
    }
    readers.clear();
  }
  ~UnreadExports() override { ReadToTheEnd(); }
  static void ExpectPutOff(const grpc::Status& status) {
    EXPECT_EQ(status.error_code(), grpc::UNAVAILABLE) << status.error_message();
    EXPECT_EQ(DetailOf(status).reason(), "NO_ROOM_NOW");
    EXPECT_GT(DetailOf(status).retry_after().seconds(), 0);
    EXPECT_NE(DetailOf(status).value(), "");
    EXPECT_NE(DetailOf(status).limit(), "");
  }
  // Retries, as a client does: the exports end a little after their readers.
  template <typename Call>
  static grpc::Status Retry(Call call) {
    grpc::Status status = call();
    for (int tries = 0; !status.ok() && tries < 500; ++tries) {
      absl::SleepFor(absl::Milliseconds(20));
      status = call();
    }
    return status;
  }

  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::ExportGaussiansResponse>>> readers;
};

TEST_F(UnreadExports, DelayAColdModelUntilTheyAreRead) {
  for (const char* scene : {"a", "b"}) {
    const grpc::Status begun = Begin(scene);
    ASSERT_TRUE(begun.ok()) << begun.error_message();
  }
  const v1::ListResidentModelsResponse list = List();
  ASSERT_EQ(list.models_size(), 2);
  for (const v1::ResidentModel& resident : list.models()) {
    ASSERT_EQ(resident.queries_in_flight(), 1) << resident.name();
  }
  const grpc::Status put_off = Ask("c");
  ExpectPutOff(put_off);
  EXPECT_NE(put_off.error_message().find("scenes/c/models/1: needs"), std::string::npos)
      << put_off.error_message();
  EXPECT_EQ(List().num_evictions(), 0);
  EXPECT_TRUE(Ask("a").ok()) << "what is resident is asked all the same";
  ReadToTheEnd();
  const grpc::Status asked = Retry([this] { return Ask("c"); });
  EXPECT_TRUE(asked.ok()) << asked.error_message();
}

TEST_F(UnreadExports, DelayAnotherExportThatDoesNotFit) {
  grpc::Status status;
  while (readers.size() < 1000 && (status = Begin("a")).ok()) {
  }
  EXPECT_GT(readers.size(), 1);
  ExpectPutOff(status);
  ReadToTheEnd();
  status = Retry([this] { return Begin("a"); });
  EXPECT_TRUE(status.ok()) << status.error_message();
}

TEST_F(AdminTest, KeepsPinnedModelsUntilTheirSceneIsDeleted) {
  ASSERT_TRUE(Pin("scenes/a/models/live").ok());
  const grpc::Status refused = Unload(NameOf("a"));
  EXPECT_EQ(refused.error_code(), grpc::FAILED_PRECONDITION);
  EXPECT_EQ(DetailOf(refused).reason(), "PINNED");
  EXPECT_TRUE(Ask("a").ok());
  EXPECT_EQ(Unpin(NameOf("b")).error_code(), grpc::NOT_FOUND) << "not in memory";
  grpc::ClientContext context;
  v1::DeleteSceneRequest request;
  request.set_name("scenes/a");
  google::protobuf::Empty empty;
  ASSERT_TRUE(running.scenes->DeleteScene(&context, request, &empty).ok());
  EXPECT_EQ(List().models_size(), 0);
}

TEST_F(AdminTest, UnpinsAModelSoThatItMayBeUnloaded) {
  ASSERT_TRUE(Pin("scenes/a/models/live").ok());
  EXPECT_TRUE(model.pinned());
  EXPECT_EQ(model.queries_in_flight(), 0);
  ASSERT_TRUE(Unpin(NameOf("a")).ok());
  EXPECT_EQ(model.name(), NameOf("a"));
  EXPECT_FALSE(model.pinned());
  EXPECT_TRUE(Unpin(NameOf("a")).ok()) << "again";
  EXPECT_TRUE(Unload(NameOf("a")).ok());
  const grpc::Status gone = Unpin(NameOf("a"));
  EXPECT_EQ(gone.error_code(), grpc::NOT_FOUND);
  EXPECT_EQ(DetailOf(gone).reason(), "NOT_RESIDENT");
  EXPECT_EQ(DetailOf(gone).resource(), NameOf("a"));
}

TEST_F(AdminTest, IsServedOnItsOwnListenerOnly) {
  const auto elsewhere = v1::AdminService::NewStub(running.channel);
  grpc::ClientContext to_services;
  v1::ListResidentModelsResponse response;
  EXPECT_EQ(elsewhere->ListResidentModels(&to_services, {}, &response).error_code(),
            grpc::UNIMPLEMENTED);
  EXPECT_NE(running.server->admin_port(), 0);
  EXPECT_NE(running.server->admin_port(), running.server->port());
  const auto socket = grpc::CreateChannel(absl::StrCat("127.0.0.1:", running.server->admin_port()),
                                          grpc::InsecureChannelCredentials());
  grpc::ClientContext over_socket;
  EXPECT_TRUE(
      v1::AdminService::NewStub(socket)->ListResidentModels(&over_socket, {}, &response).ok());
  grpc::ClientContext to_admin;
  v1::ListScenesResponse scenes;
  EXPECT_EQ(v1::SceneService::NewStub(socket)->ListScenes(&to_admin, {}, &scenes).error_code(),
            grpc::UNIMPLEMENTED);

  running.options.admin = "unix:" + (running.folder / "admin.sock").string();
  running.Restart();
  const auto unix_socket =
      grpc::CreateChannel(running.options.admin, grpc::InsecureChannelCredentials());
  grpc::ClientContext over_unix;
  EXPECT_TRUE(
      v1::AdminService::NewStub(unix_socket)->ListResidentModels(&over_unix, {}, &response).ok());

  running.options.admin.clear();
  running.admin.reset();
  running.Restart();
  EXPECT_EQ(running.server->InProcessAdminChannel(), nullptr);
  EXPECT_EQ(running.server->admin_port(), 0);
}

TEST(AdminListener, RefusesOtherMachinesUnlessToldTo) {
  const testing::TempFolder folder;
  ServerOptions options;
  options.data = folder.path();
  options.worker = PEPESEG_MODEL_WORKER;
  options.device = "cpu";
  options.admin = "0.0.0.0:0";
  const auto refused = Server::Start(options);
  EXPECT_TRUE(absl::IsFailedPrecondition(refused.status())) << refused.status();
  EXPECT_NE(refused.status().message().find("listening on 0.0.0.0:0"), std::string::npos);
  options.insecure = true;
  EXPECT_TRUE(Server::Start(options).ok());
}

}  // namespace
}  // namespace pepeseg
