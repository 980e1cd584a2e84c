// The audit log has each change, whatever becomes of the client that asked for it.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>
#include <vector>

#include "server/access/audit_log.h"
#include "server/store/layout.h"
#include "server/store/soci.h"
#include "tests/server/service_test.h"

namespace pepeseg {
namespace {

using ::testing::AnyOf;

struct Audit : EmptyScene {
  Audit() : EmptyScene(PEPESEG_FAKE_WORKER) {}

  // Returns the lines of a method.
  std::vector<nlohmann::json> LinesOf(const std::string& method) const {
    std::vector<nlohmann::json> lines;
    std::ifstream file(AuditPath(running.options.data));
    for (std::string text; std::getline(file, text) && !file.eof();) {  // whole lines
      nlohmann::json line = nlohmann::json::parse(text);
      if (line["method"] == "pepeseg.v1." + method) lines.push_back(std::move(line));
    }
    return lines;
  }
  // Waits until a method has that many lines, and returns them.
  std::vector<nlohmann::json> AwaitLines(const std::string& method, size_t count) const {
    EXPECT_TRUE(Eventually([&] { return LinesOf(method).size() >= count; })) << method;
    return LinesOf(method);
  }
  // Expects that the last two lines are of one call, and that it ended so.
  static void ExpectCall(const std::vector<nlohmann::json>& lines,
                         const ::testing::Matcher<std::string>& outcome) {
    ASSERT_GE(lines.size(), 2u);
    const nlohmann::json &begun = lines[lines.size() - 2], &ended = lines.back();
    EXPECT_EQ(begun["outcome"], AuditEntry::kBegun);
    EXPECT_THAT(ended["outcome"].get<std::string>(), outcome);
    EXPECT_NE(begun["call"], "");
    EXPECT_EQ(ended["call"], begun["call"]);
    EXPECT_EQ(ended["resources"], begun["resources"]);
  }
};

TEST_F(Audit, HasAChangeWhoseClientWentAwayBeforeItsCommit) {
  soci::session other(soci::sqlite3, DatabasePath(running.options.data).string());
  other << "BEGIN IMMEDIATE";  // no other connection commits
  grpc::ClientContext context;
  v1::CreateSceneRequest request;
  request.set_scene_id("annex");
  grpc::Status status;
  std::thread client([&] {
    v1::Scene scene;
    status = SceneStub(running.channel).CreateScene(&context, request, &scene);
  });
  const auto begun = AwaitLines("SceneService.CreateScene", 3);  // "shelf" has two
  EXPECT_EQ(begun.back()["resources"], nlohmann::json({"annex"}));
  context.TryCancel();
  client.join();
  EXPECT_ERROR(status, grpc::CANCELLED);
  EXPECT_EQ(LinesOf("SceneService.CreateScene").size(), 3u) << "it waits for the database";
  other << "COMMIT";
  ExpectCall(AwaitLines("SceneService.CreateScene", 4), "OK");
  EXPECT_OK(Call(&SceneStub::GetScene, Named{"scenes/annex"}));
}

TEST_F(Audit, HasAnUploadThatWasCutOff) {
  const TestFile file = {"a.jpg", "bytes"};
  const v1::Upload upload = running.CreateUpload("shelf", {file});
  grpc::ClientContext context;
  v1::WriteFilesResponse response;
  const auto writer = running.datasets->WriteFiles(&context, &response);
  for (const auto& part : FileParts(upload.name(), file)) ASSERT_TRUE(writer->Write(part));
  const auto begun = AwaitLines("DatasetService.WriteFiles", 1);
  EXPECT_EQ(begun.back()["resources"], nlohmann::json({upload.name()}));
  context.TryCancel();
  EXPECT_ERROR(writer->Finish(), grpc::CANCELLED);
  // OK: the server saw the end of the stream first, and the cancellation later.
  ExpectCall(AwaitLines("DatasetService.WriteFiles", 2), AnyOf("OK", "CANCELLED"));
}

TEST_F(Audit, HasTheOutcomeOfEachUploadOfAStream) {
  std::vector<v1::WriteFilesRequest> parts;
  for (const char* path : {"a.jpg", "b.jpg"}) {
    const TestFile file = {path, "bytes"};
    const v1::Upload upload = running.CreateUpload("shelf", {file});
    for (const auto& part : FileParts(upload.name(), file)) parts.push_back(part);
  }
  ASSERT_OK(running.Write(parts));
  const auto lines = LinesOf("DatasetService.WriteFiles");
  ASSERT_EQ(lines.size(), 4u);
  ExpectCall({lines[0], lines[1]}, "OK");
  ExpectCall({lines[2], lines[3]}, "OK");
  EXPECT_NE(lines[0]["resources"], lines[2]["resources"]);
  EXPECT_NE(lines[0]["call"], lines[2]["call"]);
}

}  // namespace
}  // namespace pepeseg
