// Keys and projects as clients see them.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "google/protobuf/util/time_util.h"
#include "tests/server/access/keyed_server.h"

namespace pepeseg {
namespace {

struct Keys : KeyedServer {
  grpc::Status GetScene(const std::string& id, const std::string& secret) {
    v1::GetSceneRequest request;
    request.set_name("scenes/" + id);
    v1::Scene scene;
    return running.scenes->GetScene(With(secret).get(), request, &scene);
  }
  grpc::Status CreateScene(const std::string& id, const std::string& secret,
                           const std::string& request_id = "") {
    v1::CreateSceneRequest request;
    request.set_scene_id(id);
    request.set_request_id(request_id);
    v1::Scene scene;
    return running.scenes->CreateScene(With(secret).get(), request, &scene);
  }
  grpc::Status DeleteScene(const std::string& id, const std::string& secret) {
    v1::DeleteSceneRequest request;
    request.set_name("scenes/" + id);
    google::protobuf::Empty empty;
    return running.scenes->DeleteScene(With(secret).get(), request, &empty);
  }
  std::vector<std::string> ListScenes(const std::string& secret) {
    v1::ListScenesResponse response;
    EXPECT_TRUE(running.scenes->ListScenes(With(secret).get(), {}, &response).ok());
    std::vector<std::string> names;
    for (const v1::Scene& scene : response.scenes()) names.push_back(scene.name());
    return names;
  }
  int CountJobs(const std::string& secret) {
    v1::ListJobsResponse response;
    EXPECT_TRUE(running.jobs->ListJobs(With(secret).get(), {}, &response).ok());
    return response.jobs_size();
  }
  grpc::Status CreateKey(const v1::CreateKeyRequest& request, v1::CreateKeyResponse* response) {
    return running.admin->CreateKey(With(operates).get(), request, response);
  }
  v1::ListKeysResponse ListKeys(const v1::ListKeysRequest& request) {
    v1::ListKeysResponse response;
    EXPECT_TRUE(running.admin->ListKeys(With(operates).get(), request, &response).ok());
    return response;
  }
};

TEST_F(Keys, LetOperatorsNameTheProjectOfAScene) {
  const std::string third = MakeKey("third", {v1::SCOPE_READ, v1::SCOPE_WRITE});
  ASSERT_TRUE(CreateScene("annex", stranger).ok());
  ASSERT_TRUE(CreateScene("annex", third).ok());
  const auto load = [&](const std::string& scene) {
    v1::LoadModelRequest request;
    request.set_name(scene + "/models/1");
    return Ask("pepeseg.v1.AdminService.LoadModel", request, operates);
  };
  EXPECT_TRUE(load("scenes/shelf").ok()) << "the default project's";
  EXPECT_TRUE(load("projects/default/scenes/shelf").ok());
  const grpc::Status ambiguous = load("scenes/annex");
  EXPECT_EQ(ambiguous.error_code(), grpc::FAILED_PRECONDITION);
  EXPECT_EQ(DetailOf(ambiguous).reason(), "AMBIGUOUS_SCENE");
  EXPECT_NE(ambiguous.error_message().find("projects/other/scenes/annex"), std::string::npos);
  const grpc::Status none = load("projects/other/scenes/annex");
  EXPECT_EQ(none.error_code(), grpc::NOT_FOUND) << none.error_message();
  EXPECT_EQ(none.error_message(), "scenes/annex/models/1 does not exist");
  EXPECT_EQ(load("projects/other/scenes/shelf").error_code(), grpc::NOT_FOUND);
  EXPECT_EQ(load("projects/No/scenes/shelf").error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(load("scenes/1@annex").error_code(), grpc::INVALID_ARGUMENT);
}

TEST_F(Keys, SeeOnlyScenesAndJobsOfTheirProject) {
  ASSERT_TRUE(CreateScene("annex", stranger).ok());
  EXPECT_EQ(ListScenes(full), std::vector<std::string>{"scenes/shelf"});
  EXPECT_EQ(ListScenes(stranger), std::vector<std::string>{"scenes/annex"});
  EXPECT_EQ(CountJobs(full), 1);
  EXPECT_EQ(CountJobs(stranger), 0);
  // Request ids and scene ids are unique within a project only.
  ASSERT_TRUE(CreateScene("one", full, "request").ok());
  EXPECT_TRUE(CreateScene("two", stranger, "request").ok());
  EXPECT_TRUE(CreateScene("shelf", stranger).ok());
  EXPECT_EQ(CreateScene("shelf", stranger).error_code(), grpc::ALREADY_EXISTS);
  // A server without keys shows all of them.
  running.options.access.require_keys = false;
  running.Restart();
  EXPECT_EQ(ListScenes(nobody),
            (std::vector<std::string>{"scenes/annex", "scenes/one", "projects/other/scenes/shelf",
                                      "scenes/shelf", "scenes/two"}));
  EXPECT_TRUE(GetScene("shelf", nobody).ok()) << "the default project's";
  EXPECT_EQ(CountJobs(nobody), 1);
  EXPECT_TRUE(GetScene("annex", nobody).ok());
  EXPECT_EQ(GetScene("nowhere", nobody).error_code(), grpc::NOT_FOUND);
}

TEST_F(Keys, AreRefusedOnceRevoked) {
  ASSERT_TRUE(GetScene("shelf", reader).ok());
  const v1::ListKeysResponse list = ListKeys({});
  for (const v1::ApiKey& key : list.keys()) {
    if (key.scopes_size() != 1 || key.scopes(0) != v1::SCOPE_READ) continue;
    v1::RevokeKeyRequest request;
    request.set_name(key.name());
    v1::ApiKey first, again;
    ASSERT_TRUE(running.admin->RevokeKey(With(operates).get(), request, &first).ok());
    EXPECT_TRUE(first.has_revoke_time());
    ASSERT_TRUE(running.admin->RevokeKey(With(operates).get(), request, &again).ok());
    EXPECT_EQ(first.DebugString(), again.DebugString());
  }
  EXPECT_EQ(GetScene("shelf", reader).error_code(), grpc::UNAUTHENTICATED);
  EXPECT_TRUE(GetScene("shelf", full).ok());
  v1::RevokeKeyRequest request;
  request.set_name("keys/0000000000000000");
  v1::ApiKey key;
  EXPECT_EQ(running.admin->RevokeKey(With(operates).get(), request, &key).error_code(),
            grpc::NOT_FOUND);
  request.set_name("keys/../x");
  EXPECT_EQ(running.admin->RevokeKey(With(operates).get(), request, &key).error_code(),
            grpc::INVALID_ARGUMENT);
}

TEST_F(Keys, AreReturnedByNameWithoutTheirSecret) {
  v1::CreateKeyRequest create;
  create.set_project("lab");
  create.set_display_name("a camera");
  create.add_scopes(v1::SCOPE_WRITE);
  v1::CreateKeyResponse made;
  ASSERT_TRUE(CreateKey(create, &made).ok());
  const auto get = [&](const std::string& name, v1::ApiKey& key) {
    v1::GetKeyRequest request;
    request.set_name(name);
    return running.admin->GetKey(With(operates).get(), request, &key);
  };
  v1::ApiKey key;
  ASSERT_TRUE(get(made.key().name(), key).ok());
  EXPECT_EQ(key.DebugString(), made.key().DebugString());
  EXPECT_EQ(key.DebugString().find(made.secret()), std::string::npos);
  v1::RevokeKeyRequest revoke;
  revoke.set_name(made.key().name());
  v1::ApiKey revoked;
  ASSERT_TRUE(running.admin->RevokeKey(With(operates).get(), revoke, &revoked).ok());
  ASSERT_TRUE(get(made.key().name(), key).ok()) << "revoked keys, too";
  EXPECT_EQ(key.DebugString(), revoked.DebugString());
  const grpc::Status none = get("keys/0000000000000000", key);
  EXPECT_EQ(none.error_code(), grpc::NOT_FOUND);
  EXPECT_EQ(DetailOf(none).reason(), "NO_SUCH_KEY");
  EXPECT_EQ(DetailOf(get("keys/x", key)).field(), "name");
}

TEST_F(Keys, NoticeASceneThatAnotherProjectCreatedAgain) {
  ASSERT_TRUE(CreateScene("moved", full).ok());
  ASSERT_TRUE(GetScene("moved", full).ok());
  ASSERT_TRUE(DeleteScene("moved", full).ok());
  ASSERT_TRUE(CreateScene("moved", stranger).ok());
  EXPECT_EQ(GetScene("moved", full).error_code(), grpc::PERMISSION_DENIED);
  EXPECT_TRUE(GetScene("moved", stranger).ok());
}

TEST_F(Keys, AreRefusedOnceExpired) {
  v1::CreateKeyRequest request;
  request.set_project("default");
  request.add_scopes(v1::SCOPE_READ);
  *request.mutable_expire_time() = google::protobuf::util::TimeUtil::MillisecondsToTimestamp(
      absl::ToUnixMillis(absl::Now() + absl::Seconds(2)));
  v1::CreateKeyResponse made;
  ASSERT_TRUE(CreateKey(request, &made).ok());
  EXPECT_TRUE(GetScene("shelf", made.secret()).ok());
  absl::SleepFor(absl::Milliseconds(2100));
  EXPECT_EQ(GetScene("shelf", made.secret()).error_code(), grpc::UNAUTHENTICATED);
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
  const auto field_of = [this](const v1::CreateKeyRequest& request) {
    v1::CreateKeyResponse response;
    const grpc::Status status = CreateKey(request, &response);
    EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT) << status.error_message();
    return DetailOf(status).field();
  };
  v1::CreateKeyRequest good;
  good.set_project("default");
  good.add_scopes(v1::SCOPE_READ);
  v1::CreateKeyRequest request = good;
  request.set_project("No Label");
  EXPECT_EQ(field_of(request), "project");
  request = good;
  request.clear_scopes();
  EXPECT_EQ(field_of(request), "scopes");
  request.add_scopes(v1::SCOPE_UNSPECIFIED);
  EXPECT_EQ(field_of(request), "scopes[0]");
  request = good;
  request.mutable_expire_time()->set_seconds(1);
  EXPECT_EQ(field_of(request), "expire_time");
  request = good;
  request.set_display_name(std::string(257, 'x'));
  EXPECT_EQ(field_of(request), "display_name");
}

TEST_F(Keys, AreCheckedAtEachUploadOfAStream) {
  ASSERT_TRUE(CreateScene("annex", stranger).ok());
  v1::CreateUploadRequest create;
  create.set_parent("scenes/annex");
  *create.add_files() = Declare({"a.jpg", "bytes"});
  v1::Upload own;
  ASSERT_TRUE(running.datasets->CreateUpload(With(stranger).get(), create, &own).ok());
  std::vector<v1::WriteFilesRequest> parts = FileParts(own.name(), {"a.jpg", "bytes"});
  parts.push_back(HeaderPart("scenes/shelf/uploads/1", "file"));
  std::vector<const google::protobuf::Message*> messages;
  for (const auto& part : parts) messages.push_back(&part);
  const grpc::Status changed = Ask("pepeseg.v1.DatasetService.WriteFiles", messages, stranger);
  EXPECT_EQ(changed.error_code(), grpc::PERMISSION_DENIED) << changed.error_message();
  EXPECT_EQ(DetailOf(changed).field(), "header.upload");
  // Files that came before are kept.
  v1::GetUploadRequest get;
  get.set_name(own.name());
  v1::Upload upload;
  ASSERT_TRUE(running.datasets->GetUpload(With(stranger).get(), get, &upload).ok());
  EXPECT_EQ(upload.missing_files_size(), 0);
  EXPECT_EQ(Ask("pepeseg.v1.DatasetService.WriteFiles", {}, nobody).error_code(),
            grpc::UNAUTHENTICATED);
}

TEST_F(Keys, AreCheckedAtEachQueryOfAStream) {
  const auto context = With(full);
  const auto stream = running.segmentation->StreamSegments(context.get());
  v1::StreamSegmentsRequest request;
  request.set_sequence(1);
  v1::SegmentViewsRequest& segment = *request.mutable_segment();
  segment.set_model("scenes/shelf/models/live");
  segment.mutable_prompt()->mutable_view()->set_view("middle.jpg");
  auto& point = *segment.mutable_prompt()->mutable_points()->add_points();
  point.set_x(30);
  point.set_y(32);
  ASSERT_TRUE(stream->Write(request));
  v1::StreamSegmentsResponse response;
  ASSERT_TRUE(stream->Read(&response));
  EXPECT_EQ(response.segment().model(), "scenes/shelf/models/1");
  ASSERT_TRUE(CreateScene("annex", stranger).ok());
  segment.set_model("scenes/annex/models/live");
  ASSERT_TRUE(stream->Write(request));
  EXPECT_FALSE(stream->Read(&response));
  EXPECT_EQ(stream->Finish().error_code(), grpc::PERMISSION_DENIED);
  EXPECT_EQ(Ask("pepeseg.v1.SegmentationService.StreamSegments", {}, nobody).error_code(),
            grpc::UNAUTHENTICATED);
}

TEST_F(Keys, LeaveTracesInTheLogsButNotTheirSecrets) {
  ASSERT_TRUE(CreateScene("annex", stranger).ok());
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
