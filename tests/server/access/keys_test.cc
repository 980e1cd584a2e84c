// Keys and projects as clients see them.
#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "google/protobuf/util/time_util.h"
#include "tests/server/access/keyed_server.h"
#include "tests/server/shelf_model.h"
#include "tests/testing/eventually.h"

namespace pepeseg {
namespace {

struct Keys : KeyedServer {
  grpc::Status GetScene(const std::string& id, const std::string& secret) const {
    return CallAs(secret, &SceneStub::GetScene, Named{"scenes/" + id});
  }
  grpc::Status CreateScene(const std::string& id, const std::string& secret,
                           const std::string& request_id = "") const {
    v1::CreateSceneRequest request;
    request.set_scene_id(id);
    request.set_request_id(request_id);
    return CallAs(secret, &SceneStub::CreateScene, request);
  }
  std::vector<std::string> ListScenes(const std::string& secret) const {
    const v1::ListScenesResponse response = *CallAs(secret, &SceneStub::ListScenes, {});
    std::vector<std::string> names;
    for (const v1::Scene& scene : response.scenes()) names.push_back(scene.name());
    return names;
  }
  int CountJobs(const std::string& secret) const {
    return CallAs(secret, &JobStub::ListJobs, {})->jobs_size();
  }
  Reply<v1::CreateKeyResponse> CreateKey(const v1::CreateKeyRequest& request) const {
    return CallAs(operates, &AdminStub::CreateKey, request);
  }
  Reply<v1::ApiKey> RevokeKey(const std::string& name) const {
    return CallAs(operates, &AdminStub::RevokeKey, Named{name});
  }
  v1::ListKeysResponse ListKeys(const v1::ListKeysRequest& request) const {
    return *CallAs(operates, &AdminStub::ListKeys, request);
  }
};

TEST_F(Keys, LetOperatorsNameTheProjectOfAScene) {
  const std::string third = MakeKey("third", {v1::SCOPE_READ, v1::SCOPE_WRITE});
  ASSERT_OK(CreateScene("annex", stranger));
  ASSERT_OK(CreateScene("annex", third));
  const auto load = [&](const std::string& scene) {
    return CallAs(operates, &AdminStub::LoadModel, Named{scene + "/models/1"});
  };
  EXPECT_OK(load("scenes/shelf")) << "the default project's";
  EXPECT_OK(load("projects/default/scenes/shelf"));
  EXPECT_ERROR(load("scenes/annex"), grpc::FAILED_PRECONDITION,
               {.reason = "AMBIGUOUS_SCENE", .message = "projects/other/scenes/annex"});
  const grpc::Status none = load("projects/other/scenes/annex");
  EXPECT_ERROR(none, grpc::NOT_FOUND);
  EXPECT_EQ(none.error_message(), "scenes/annex/models/1 does not exist");
  EXPECT_ERROR(load("projects/other/scenes/shelf"), grpc::NOT_FOUND);
  EXPECT_ERROR(load("projects/No/scenes/shelf"), grpc::INVALID_ARGUMENT);
  EXPECT_ERROR(load("scenes/1@annex"), grpc::INVALID_ARGUMENT);
}

TEST_F(Keys, SeeOnlyScenesAndJobsOfTheirProject) {
  ASSERT_OK(CreateScene("annex", stranger));
  EXPECT_EQ(ListScenes(full), std::vector<std::string>{"scenes/shelf"});
  EXPECT_EQ(ListScenes(stranger), std::vector<std::string>{"scenes/annex"});
  EXPECT_EQ(CountJobs(full), 1);
  EXPECT_EQ(CountJobs(stranger), 0);
  // Request ids and scene ids are unique within a project only.
  ASSERT_OK(CreateScene("one", full, "request"));
  EXPECT_OK(CreateScene("two", stranger, "request"));
  EXPECT_OK(CreateScene("shelf", stranger));
  EXPECT_ERROR(CreateScene("shelf", stranger), grpc::ALREADY_EXISTS);
  // A server without keys shows all of them.
  running.options.access.require_keys = false;
  running.Restart();
  EXPECT_EQ(ListScenes(nobody),
            (std::vector<std::string>{"scenes/annex", "scenes/one", "scenes/shelf",
                                      "projects/other/scenes/shelf", "scenes/two"}));
  EXPECT_OK(GetScene("shelf", nobody)) << "the default project's";
  EXPECT_EQ(CountJobs(nobody), 1);
  EXPECT_OK(GetScene("annex", nobody));
  EXPECT_ERROR(GetScene("nowhere", nobody), grpc::NOT_FOUND);
}

TEST_F(Keys, AreRefusedOnceRevoked) {
  ASSERT_OK(GetScene("shelf", reader));
  const v1::ListKeysResponse list = ListKeys({});
  for (const v1::ApiKey& key : list.keys()) {
    if (key.scopes_size() != 1 || key.scopes(0) != v1::SCOPE_READ) continue;
    const v1::ApiKey first = *RevokeKey(key.name());
    EXPECT_TRUE(first.has_revoke_time());
    EXPECT_EQ(RevokeKey(key.name())->DebugString(), first.DebugString());
  }
  EXPECT_ERROR(GetScene("shelf", reader), grpc::UNAUTHENTICATED);
  EXPECT_OK(GetScene("shelf", full));
  EXPECT_ERROR(RevokeKey("keys/0000000000000000"), grpc::NOT_FOUND);
  EXPECT_ERROR(RevokeKey("keys/../x"), grpc::INVALID_ARGUMENT);
}

TEST_F(Keys, AreReturnedByNameWithoutTheirSecret) {
  v1::CreateKeyRequest create;
  create.set_project("lab");
  create.set_display_name("a camera");
  create.add_scopes(v1::SCOPE_WRITE);
  ASSERT_OK_AND_ASSIGN(const v1::CreateKeyResponse made, CreateKey(create));
  const auto get = [&](const std::string& name) {
    return CallAs(operates, &AdminStub::GetKey, Named{name});
  };
  const std::string key = get(made.key().name())->DebugString();
  EXPECT_EQ(key, made.key().DebugString());
  EXPECT_EQ(key.find(made.secret()), std::string::npos);
  const std::string revoked = RevokeKey(made.key().name())->DebugString();
  EXPECT_EQ(get(made.key().name())->DebugString(), revoked) << "revoked keys, too";
  EXPECT_ERROR(get("keys/0000000000000000"), grpc::NOT_FOUND, {.reason = "NO_SUCH_KEY"});
  EXPECT_ERROR(get("keys/x"), grpc::INVALID_ARGUMENT, "name");
}

TEST_F(Keys, NoticeASceneThatAnotherProjectCreatedAgain) {
  ASSERT_OK(CreateScene("moved", full));
  ASSERT_OK(GetScene("moved", full));
  ASSERT_OK(CallAs(full, &SceneStub::DeleteScene, Named{"scenes/moved"}));
  ASSERT_OK(CreateScene("moved", stranger));
  EXPECT_ERROR(GetScene("moved", full), grpc::PERMISSION_DENIED);
  EXPECT_OK(GetScene("moved", stranger));
}

TEST_F(Keys, AreRefusedOnceExpired) {
  v1::CreateKeyRequest request;
  request.set_project("default");
  request.add_scopes(v1::SCOPE_READ);
  *request.mutable_expire_time() = google::protobuf::util::TimeUtil::MillisecondsToTimestamp(
      absl::ToUnixMillis(absl::Now() + absl::Seconds(2)));
  const std::string secret = CreateKey(request)->secret();
  EXPECT_OK(GetScene("shelf", secret));
  EXPECT_TRUE(testing::Eventually([&] { return !GetScene("shelf", secret).ok(); }));
  EXPECT_ERROR(GetScene("shelf", secret), grpc::UNAUTHENTICATED);
}

TEST_F(Keys, AreListedWithoutTheirSecrets) {
  v1::ListKeysRequest request;
  EXPECT_EQ(ListKeys(request).keys_size(), 4);
  request.set_project("other");
  ASSERT_EQ(ListKeys(request).keys_size(), 1);
  EXPECT_EQ(ListKeys(request).keys(0).scopes_size(), 3);
  request.clear_project();
  request.set_page_size(3);
  const v1::ListKeysResponse first = ListKeys(request);
  EXPECT_EQ(first.keys_size(), 3);
  request.set_page_token(first.next_page_token());
  const v1::ListKeysResponse second = ListKeys(request);
  ASSERT_EQ(second.keys_size(), 1);
  EXPECT_GT(second.keys(0).name(), first.keys(2).name());
  EXPECT_EQ(second.next_page_token(), "");
  for (const std::string& secret : {stranger, reader, full, operates}) {
    EXPECT_EQ(first.DebugString().find(secret), std::string::npos);
  }
}

TEST_F(Keys, AreRefusedByFieldIfInvalid) {
  using Change = std::function<void(v1::CreateKeyRequest&)>;
  const std::vector<std::pair<std::string, Change>> cases = {
      {"project", [](auto& request) { request.set_project("No Label"); }},
      {"scopes", [](auto& request) { request.clear_scopes(); }},
      {"scopes[0]", [](auto& request) { request.set_scopes(0, v1::SCOPE_UNSPECIFIED); }},
      {"expire_time", [](auto& request) { request.mutable_expire_time()->set_seconds(1); }},
      {"display_name", [](auto& request) { request.set_display_name(std::string(257, 'x')); }}};
  for (const auto& [field, change] : cases) {
    v1::CreateKeyRequest request;
    request.set_project("default");
    request.add_scopes(v1::SCOPE_READ);
    change(request);
    EXPECT_ERROR(CreateKey(request), grpc::INVALID_ARGUMENT, field);
  }
}

TEST_F(Keys, AreCheckedAtEachUploadOfAStream) {
  ASSERT_OK(CreateScene("annex", stranger));
  v1::CreateUploadRequest create = Under{"scenes/annex"};
  *create.add_files() = Declare({"a.jpg", "bytes"});
  ASSERT_OK_AND_ASSIGN(const v1::Upload own, CallAs(stranger, &DatasetStub::CreateUpload, create));
  std::vector<v1::WriteFilesRequest> parts = FileParts(own.name(), {"a.jpg", "bytes"});
  parts.push_back(HeaderPart("scenes/shelf/uploads/1", "file"));
  std::vector<const google::protobuf::Message*> messages;
  for (const auto& part : parts) messages.push_back(&part);
  EXPECT_ERROR(Ask("pepeseg.v1.DatasetService.WriteFiles", messages, stranger),
               grpc::PERMISSION_DENIED, "header.upload");
  // Files that came before are kept.
  EXPECT_EQ(CallAs(stranger, &DatasetStub::GetUpload, Named{own.name()})->missing_files_size(), 0);
  EXPECT_ERROR(Ask("pepeseg.v1.DatasetService.WriteFiles", {}, nobody), grpc::UNAUTHENTICATED);
}

TEST_F(Keys, AreCheckedAtEachQueryOfAStream) {
  const auto context = With(full);
  const auto stream = running.segmentation->StreamSegments(context.get());
  v1::StreamSegmentsRequest request;
  request.set_sequence(1);
  v1::SegmentViewsRequest& segment = *request.mutable_segment();
  segment = Click<v1::SegmentViewsRequest>(30);
  ASSERT_TRUE(stream->Write(request));
  v1::StreamSegmentsResponse response;
  ASSERT_TRUE(stream->Read(&response));
  EXPECT_EQ(response.segment().model(), "scenes/shelf/models/1");
  ASSERT_OK(CreateScene("annex", stranger));
  segment.set_model("scenes/annex/models/live");
  ASSERT_TRUE(stream->Write(request));
  EXPECT_FALSE(stream->Read(&response));
  EXPECT_ERROR(stream->Finish(), grpc::PERMISSION_DENIED);
  EXPECT_ERROR(Ask("pepeseg.v1.SegmentationService.StreamSegments", {}, nobody),
               grpc::UNAUTHENTICATED);
}

TEST_F(Keys, LeaveTracesInTheLogsButNotTheirSecrets) {
  ASSERT_OK(CreateScene("annex", stranger));
  EXPECT_FALSE(GetScene("shelf", stranger).ok());
  EXPECT_FALSE(GetScene("shelf", "pk_wrong").ok());
  const std::string log = ReadAudit();
  std::vector<nlohmann::json> lines;
  for (const std::string& line : std::vector<std::string>(absl::StrSplit(log, '\n'))) {
    if (!line.empty()) lines.push_back(nlohmann::json::parse(line));
  }
  ASSERT_GE(lines.size(), 2u);
  const nlohmann::json& created = lines[lines.size() - 2];
  EXPECT_EQ(created["method"], "pepeseg.v1.SceneService.CreateScene");
  EXPECT_EQ(created["project"], "other");
  EXPECT_EQ(created["outcome"], "OK");
  EXPECT_EQ(lines[lines.size() - 1]["reason"], "NOT_YOURS");
  const std::string refusals = ReadRefusals();
  EXPECT_NE(refusals.find("UNAUTHENTICATED"), std::string::npos);
  EXPECT_NE(log.find("AdminService.CreateKey"), std::string::npos);
  for (const std::string& secret : {stranger, reader, full, operates}) {
    EXPECT_EQ((log + refusals).find(secret.substr(3)), std::string::npos);
  }
}

}  // namespace
}  // namespace pepeseg
