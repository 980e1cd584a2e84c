#include <gtest/gtest.h>

#include "tests/server/running_server.h"

namespace pepeseg {
namespace {

struct SceneServiceTest : ::testing::Test {
  SceneServiceTest() : running(PEPESEG_FAKE_WORKER) {}

  grpc::Status Create(const std::string& id, const std::string& title,
                      const std::string& request_id) {
    grpc::ClientContext context;
    v1::CreateSceneRequest request;
    request.set_scene_id(id);
    request.mutable_scene()->set_display_name(title);
    request.set_request_id(request_id);
    return running.scenes->CreateScene(&context, request, &scene);
  }
  grpc::Status Get(const std::string& name) {
    grpc::ClientContext context;
    v1::GetSceneRequest request;
    request.set_name(name);
    return running.scenes->GetScene(&context, request, &scene);
  }
  grpc::Status List(int page_size, const std::string& token) {
    grpc::ClientContext context;
    v1::ListScenesRequest request;
    request.set_page_size(page_size);
    request.set_page_token(token);
    list.Clear();
    return running.scenes->ListScenes(&context, request, &list);
  }
  grpc::Status Delete(const std::string& name) {
    grpc::ClientContext context;
    v1::DeleteSceneRequest request;
    request.set_name(name);
    google::protobuf::Empty empty;
    return running.scenes->DeleteScene(&context, request, &empty);
  }

  RunningServer running;
  v1::Scene scene;
  v1::ListScenesResponse list;
};

TEST_F(SceneServiceTest, CreatesGetsAndDeletes) {
  ASSERT_TRUE(Create("shelf", "A shelf \xc3\xa4", "").ok());
  EXPECT_EQ(scene.name(), "scenes/shelf");
  EXPECT_TRUE(scene.has_create_time());
  ASSERT_TRUE(Get("scenes/shelf").ok());
  EXPECT_EQ(scene.display_name(), "A shelf \xc3\xa4");
  EXPECT_EQ(scene.live_model(), "");
  EXPECT_EQ(scene.active_job(), "");
  ASSERT_TRUE(Delete("scenes/shelf").ok());
  const grpc::Status gone = Get("scenes/shelf");
  EXPECT_EQ(gone.error_code(), grpc::NOT_FOUND);
  EXPECT_EQ(DetailOf(gone).resource(), "scenes/shelf");
  EXPECT_EQ(Delete("scenes/shelf").error_code(), grpc::NOT_FOUND);
}

TEST_F(SceneServiceTest, RefusesATakenIdButAcceptsARetry) {
  ASSERT_TRUE(Create("shelf", "one", "r1").ok());
  EXPECT_TRUE(Create("shelf", "one", "r1").ok());
  const grpc::Status taken = Create("shelf", "two", "r2");
  EXPECT_EQ(taken.error_code(), grpc::ALREADY_EXISTS);
  EXPECT_EQ(DetailOf(taken).resource(), "scenes/shelf");
}

TEST_F(SceneServiceTest, AcceptsCommonNamesAndDistinguishesCase) {
  for (const char* id : {"llff_horns", "Fern-2", "fern-2", "360.v2", "1a"}) {
    ASSERT_TRUE(Create(id, "", "").ok()) << id;
    ASSERT_TRUE(Get(std::string("scenes/") + id).ok()) << id;
    EXPECT_EQ(scene.name(), std::string("scenes/") + id);
  }
  ASSERT_TRUE(Delete("scenes/Fern-2").ok());
  EXPECT_TRUE(Get("scenes/fern-2").ok());
}

TEST_F(SceneServiceTest, RefusesBadIdsAndNames) {
  for (const char* id : {"", ".", "../../x", "a/b", "-", "_a", "a b"}) {
    const grpc::Status status = Create(id, "", "");
    EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT) << id;
    EXPECT_EQ(DetailOf(status).field(), "scene_id");
  }
  EXPECT_EQ(Create("a", std::string(257, 'x'), "").error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(Create("a", "", std::string(129, 'x')).error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(Get("scenes/../x").error_code(), grpc::INVALID_ARGUMENT);
  ASSERT_TRUE(List(10, "").ok());
  EXPECT_EQ(list.scenes_size(), 0);
}

TEST_F(SceneServiceTest, ListsPageByPage) {
  for (const char* id : {"e", "b", "d", "a", "c"}) running.CreateScene(id);
  std::vector<std::string> names;
  std::string token;
  int pages = 0;
  do {
    ASSERT_TRUE(List(2, token).ok());
    ++pages;
    for (const v1::Scene& one : list.scenes()) names.push_back(one.name());
    token = list.next_page_token();
  } while (!token.empty());
  EXPECT_EQ(pages, 3);
  EXPECT_EQ(names,
            (std::vector<std::string>{"scenes/a", "scenes/b", "scenes/c", "scenes/d", "scenes/e"}));
  EXPECT_EQ(List(-1, "").error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(List(2, "no such token \xc3\xa4").error_code(), grpc::INVALID_ARGUMENT);
}

TEST_F(SceneServiceTest, RefusesToDeleteASceneWithAnActiveJob) {
  running.CreateScene("shelf");
  const v1::Job job = running.Train("shelf", "hang");
  ASSERT_TRUE(Get("scenes/shelf").ok());
  EXPECT_EQ(scene.active_job(), job.name());
  const grpc::Status status = Delete("scenes/shelf");
  EXPECT_EQ(status.error_code(), grpc::FAILED_PRECONDITION);
  EXPECT_EQ(DetailOf(status).resource(), job.name());
}

TEST_F(SceneServiceTest, DeletesTheFoldersOfItsJobs) {
  running.CreateScene("shelf");
  const v1::Job job = running.Await(running.Train("shelf", "fine").name());
  EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED);
  const auto folder = running.options.data / job.name();
  EXPECT_TRUE(std::filesystem::exists(folder));
  ASSERT_TRUE(Delete("scenes/shelf").ok());
  EXPECT_FALSE(std::filesystem::exists(folder));
}

TEST_F(SceneServiceTest, ListsTheModelsOfItsJobs) {
  running.CreateScene("shelf");
  const v1::Job first = running.Await(running.Train("shelf", "fine").name());
  const v1::Job second = running.Await(running.Train("shelf", "fine").name());
  EXPECT_EQ(first.model(), "scenes/shelf/models/1");
  grpc::ClientContext context;
  v1::ListModelsRequest request;
  request.set_parent("scenes/shelf");
  v1::ListModelsResponse models;
  ASSERT_TRUE(running.scenes->ListModels(&context, request, &models).ok());
  ASSERT_EQ(models.models_size(), 2);
  EXPECT_EQ(models.models(0).name(), second.model());
  EXPECT_EQ(models.models(0).job(), second.name());
  EXPECT_EQ(models.models(0).metrics().at("psnr"), 20.5);
  EXPECT_EQ(models.models(0).device().find("cpu (1 thread, "), 0u);
  EXPECT_EQ(models.models(0).num_gaussians(), 7);
  EXPECT_EQ(models.models(0).dataset(), second.dataset());
  EXPECT_EQ(models.models(1).dataset(), first.dataset());
  EXPECT_EQ(models.models(0).advice_size(), 0) << "a command made its masks";
  grpc::ClientContext live_context;
  v1::GetModelRequest live;
  live.set_name("scenes/shelf/models/live");
  v1::Model model;
  ASSERT_TRUE(running.scenes->GetModel(&live_context, live, &model).ok());
  EXPECT_EQ(model.name(), second.model());
  EXPECT_EQ(model.sources().poses(), "given");
  EXPECT_EQ(model.sources().masks(), "command \"x\"");
  EXPECT_EQ(model.sources().depth(), "none");
}

}  // namespace
}  // namespace pepeseg
