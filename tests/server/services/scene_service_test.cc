#include <gtest/gtest.h>

#include "tests/server/service_test.h"

namespace pepeseg {
namespace {

struct SceneServiceTest : ServiceTest {
  SceneServiceTest() : ServiceTest(PEPESEG_FAKE_WORKER) {}

  Reply<v1::Scene> Create(const std::string& id, const std::string& title,
                          const std::string& request_id) const {
    v1::CreateSceneRequest request;
    request.set_scene_id(id);
    request.mutable_scene()->set_display_name(title);
    request.set_request_id(request_id);
    return Call(&SceneStub::CreateScene, request);
  }
  Reply<v1::Scene> Get(const std::string& name) const {
    return Call(&SceneStub::GetScene, Named{name});
  }
  Reply<v1::ListScenesResponse> List(int page_size, const std::string& token) const {
    v1::ListScenesRequest request;
    request.set_page_size(page_size);
    request.set_page_token(token);
    return Call(&SceneStub::ListScenes, request);
  }
  grpc::Status Delete(const std::string& name) {
    return Call(&SceneStub::DeleteScene, Named{name});
  }
};

TEST_F(SceneServiceTest, CreatesGetsAndDeletes) {
  ASSERT_OK_AND_ASSIGN(auto scene, Create("shelf", "A shelf \xc3\xa4", ""));
  EXPECT_EQ(scene.name(), "scenes/shelf");
  EXPECT_TRUE(scene.has_create_time());
  ASSERT_OK_AND_ASSIGN(scene, Get("scenes/shelf"));
  EXPECT_EQ(scene.display_name(), "A shelf \xc3\xa4");
  EXPECT_EQ(scene.live_model(), "");
  EXPECT_EQ(scene.active_job(), "");
  ASSERT_OK(Delete("scenes/shelf"));
  EXPECT_ERROR(Get("scenes/shelf"), grpc::NOT_FOUND, {.resource = "scenes/shelf"});
  EXPECT_ERROR(Delete("scenes/shelf"), grpc::NOT_FOUND);
}

TEST_F(SceneServiceTest, RefusesATakenIdButAcceptsARetry) {
  ASSERT_OK(Create("shelf", "one", "r1"));
  EXPECT_OK(Create("shelf", "one", "r1"));
  EXPECT_ERROR(Create("shelf", "two", "r2"), grpc::ALREADY_EXISTS, {.resource = "scenes/shelf"});
}

TEST_F(SceneServiceTest, AcceptsCommonNamesAndDistinguishesCase) {
  for (const char* id : {"llff_horns", "Fern-2", "fern-2", "360.v2", "1a"}) {
    ASSERT_OK(Create(id, "", "")) << id;
    EXPECT_EQ(Get(std::string("scenes/") + id)->name(), std::string("scenes/") + id);
  }
  ASSERT_OK(Delete("scenes/Fern-2"));
  EXPECT_OK(Get("scenes/fern-2"));
}

TEST_F(SceneServiceTest, RefusesBadIdsAndNames) {
  for (const char* id : {"", ".", "../../x", "a/b", "-", "_a", "a b"}) {
    EXPECT_ERROR(Create(id, "", ""), grpc::INVALID_ARGUMENT, "scene_id") << id;
  }
  EXPECT_ERROR(Create("a", std::string(257, 'x'), ""), grpc::INVALID_ARGUMENT);
  EXPECT_ERROR(Create("a", "", std::string(129, 'x')), grpc::INVALID_ARGUMENT);
  EXPECT_ERROR(Get("scenes/../x"), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(List(10, "")->scenes_size(), 0);
}

TEST_F(SceneServiceTest, ListsPageByPage) {
  for (const char* id : {"e", "b", "d", "a", "c"}) running.CreateScene(id);
  std::vector<std::string> names;
  std::string token;
  int pages = 0;
  do {
    ASSERT_OK_AND_ASSIGN(auto list, List(2, token));
    ++pages;
    for (const v1::Scene& one : list.scenes()) names.push_back(one.name());
    token = list.next_page_token();
  } while (!token.empty());
  EXPECT_EQ(pages, 3);
  EXPECT_EQ(names,
            (std::vector<std::string>{"scenes/a", "scenes/b", "scenes/c", "scenes/d", "scenes/e"}));
  EXPECT_ERROR(List(-1, ""), grpc::INVALID_ARGUMENT);
  EXPECT_ERROR(List(2, "no such token \xc3\xa4"), grpc::INVALID_ARGUMENT);
}

TEST_F(SceneServiceTest, RefusesToDeleteASceneWithAnActiveJob) {
  running.CreateScene("shelf");
  const v1::Job job = running.Train("shelf", "hang");
  EXPECT_EQ(Get("scenes/shelf")->active_job(), job.name());
  EXPECT_ERROR(Delete("scenes/shelf"), grpc::FAILED_PRECONDITION, {.resource = job.name()});
}

TEST_F(SceneServiceTest, DeletesTheFoldersOfItsJobs) {
  running.CreateScene("shelf");
  const auto folder = running.options.data / TrainToTheEnd("shelf", "fine").name();
  EXPECT_TRUE(std::filesystem::exists(folder));
  ASSERT_OK(Delete("scenes/shelf"));
  EXPECT_FALSE(std::filesystem::exists(folder));
}

TEST_F(SceneServiceTest, ListsTheModelsOfItsJobs) {
  running.CreateScene("shelf");
  const v1::Job first = TrainToTheEnd("shelf", "fine");
  const v1::Job second = TrainToTheEnd("shelf", "fine");
  EXPECT_EQ(first.model(), "scenes/shelf/models/1");
  ASSERT_OK_AND_ASSIGN(const v1::ListModelsResponse models,
                       Call(&SceneStub::ListModels, Under{"scenes/shelf"}));
  ASSERT_EQ(models.models_size(), 2);
  EXPECT_EQ(models.models(0).name(), second.model());
  EXPECT_EQ(models.models(0).job(), second.name());
  EXPECT_EQ(models.models(0).metrics().at("psnr"), 20.5);
  EXPECT_EQ(models.models(0).device().find("cpu (1 thread, "), 0u);
  EXPECT_EQ(models.models(0).num_gaussians(), 7);
  EXPECT_EQ(models.models(0).dataset(), second.dataset());
  EXPECT_EQ(models.models(1).dataset(), first.dataset());
  EXPECT_EQ(models.models(0).advice_size(), 0) << "a command made its masks";
  ASSERT_OK_AND_ASSIGN(const v1::Model model,
                       Call(&SceneStub::GetModel, Named{"scenes/shelf/models/live"}));
  EXPECT_EQ(model.name(), second.model());
  EXPECT_EQ(model.sources().poses(), "given");
  EXPECT_EQ(model.sources().masks(), "command \"x\"");
  EXPECT_EQ(model.sources().depth(), "none");
}

}  // namespace
}  // namespace pepeseg
