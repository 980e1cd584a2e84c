// Quotas, as callers and operators see them.
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "tests/server/service_test.h"

namespace pepeseg {
namespace {

struct QuotaTest : ServiceTest {
  QuotaTest() : ServiceTest(PEPESEG_MODEL_WORKER, WithAdmin()) {
    for (const char* scene : {"a", "b"}) running.CreateScene(scene);
  }

  Reply<v1::ProjectUsage> Set(const v1::Quota& quota,
                              const std::string& project = "default") const {
    v1::UpdateQuotaRequest request;
    request.set_project(project);
    *request.mutable_quota() = quota;
    return Call(&AdminStub::UpdateQuota, request);
  }
  v1::ProjectUsage Usage() const {
    v1::GetProjectUsageRequest request;
    request.set_project("default");
    return *Call(&AdminStub::GetProjectUsage, request);
  }
  v1::Quota Used() const { return Usage().used(); }
  grpc::Status Create(const std::string& scene, const std::vector<TestFile>& files) {
    v1::CreateUploadRequest request;
    request.set_parent("scenes/" + scene);
    for (const TestFile& file : files) *request.add_files() = Declare(file);
    return Call(&DatasetStub::CreateUpload, request);
  }
  grpc::Status Train(const std::string& scene, const std::string& dataset) {
    v1::TrainSceneRequest request;
    request.set_scene("scenes/" + scene);
    request.set_dataset(dataset);
    return Call(&JobStub::TrainScene, request);
  }
  grpc::Status ListViews(const std::string& scene) {
    return Call(&SceneStub::ListViews, Under{absl::StrCat("scenes/", scene, "/models/live")});
  }
  grpc::Status ListLabels() { return Call(&LabelStub::ListLabels, Under{"scenes/a"}); }
  static void ExpectQuota(const grpc::Status& status, const std::string& name) {
    EXPECT_ERROR(status, grpc::RESOURCE_EXHAUSTED, {.field = name, .reason = "QUOTA"});
    EXPECT_FALSE(DetailOf(status).value().empty() || DetailOf(status).limit().empty());
  }
};

TEST_F(QuotaTest, LimitsBytesAndOpenUploads) {
  v1::Quota quota;
  quota.set_stored_bytes(10);
  EXPECT_EQ(Set(quota)->quota().stored_bytes(), 10);
  ExpectQuota(Create("a", {{"1", "elevenbytes"}}), "stored_bytes");
  running.UploadAndSeal("a", {{"1", "tenletters"}});
  EXPECT_EQ(Used().stored_bytes(), 10);
  EXPECT_OK(Create("b", {{"other name", "tenletters"}})) << "is there already";
  quota.set_open_uploads(1);
  EXPECT_EQ(Set(quota)->used().open_uploads(), 1);
  ExpectQuota(Create("a", {{"1", "tenletters"}}), "open_uploads");
}

// Partial files whose digest no dataset has, and deleted files that the collector has not removed.
TEST_F(QuotaTest, CountsStoredBytesThatAreNotInADataset) {
  v1::Quota quota;
  quota.set_stored_bytes(20);
  ASSERT_OK(Set(quota));
  const TestFile file{"1", "tenletters"};
  ASSERT_OK(Create("a", {file}));
  running.Write({HeaderPart("scenes/a/uploads/1", "1"), ChunkPart("tenlett")});
  ASSERT_OK(Create("b", {file}));
  ExpectQuota(Create("b", {file}), "stored_bytes");
}

TEST_F(QuotaTest, CountsModelsAndSelectionsAsStoredBytes) {
  const std::string model = TrainToTheEnd("a", "file").model();
  const int64_t used = Used().stored_bytes();
  EXPECT_GT(used, 5) << "the bytes of the file";
  v1::Quota quota;
  quota.set_stored_bytes(used);
  ASSERT_OK(Set(quota));
  ExpectQuota(Train("a", "scenes/a/datasets/1"), "stored_bytes");
  ASSERT_OK(Call(&SceneStub::DeleteModel, Named{model}));
  EXPECT_EQ(Used().stored_bytes(), 5);
  EXPECT_OK(Train("a", "scenes/a/datasets/1"));
}

TEST_F(QuotaTest, LimitsQueuedJobs) {
  const std::string a = running.UploadAndSeal("a", {{"hang", "bytes"}});
  const std::string b = running.UploadAndSeal("b", {{"hang", "bytes"}});
  running.CreateScene("c");
  const std::string c = running.UploadAndSeal("c", {{"hang", "bytes"}});
  v1::Quota quota;
  quota.set_queued_jobs(1);
  ASSERT_OK(Set(quota));
  ASSERT_OK(Train("a", a));
  ASSERT_TRUE(Eventually([&] { return Used().running_jobs() > 0; }));
  ASSERT_OK(Train("b", b)) << "waits for the one slot";
  EXPECT_EQ(Used().queued_jobs(), 1);
  ExpectQuota(Train("c", c), "queued_jobs");
}

TEST_F(QuotaTest, LimitsQueries) {
  v1::Quota quota;
  quota.set_queries_per_second(2);
  ASSERT_OK(Set(quota));
  int num_refused = 0;
  grpc::Status refused;
  for (int i = 0; i < 8; ++i) {
    const grpc::Status status = ListLabels();
    if (status.ok()) continue;
    ++num_refused;
    refused = status;
  }
  EXPECT_GE(num_refused, 4);
  EXPECT_ERROR(refused, grpc::UNAVAILABLE, {.field = "queries_per_second", .reason = "QUOTA"});
  EXPECT_TRUE(DetailOf(refused).has_retry_after());
  EXPECT_GE(Used().queries_per_second(), 1);
  ASSERT_OK(Set({}));
  for (int i = 0; i < 8; ++i) EXPECT_OK(ListLabels());
}

TEST_F(QuotaTest, LimitsQueriesOfAStream) {
  v1::Quota quota;
  quota.set_queries_per_second(1);
  ASSERT_OK(Set(quota));
  ASSERT_OK(ListLabels());
  grpc::ClientContext context;
  const auto stream = running.segmentation->StreamSegments(&context);
  v1::StreamSegmentsRequest request;
  request.set_sequence(7);
  request.mutable_segment()->set_model("scenes/a/models/live");
  ASSERT_TRUE(stream->Write(request));
  v1::StreamSegmentsResponse response;
  ASSERT_TRUE(stream->Read(&response));
  EXPECT_EQ(response.error().code(), grpc::UNAVAILABLE) << response.error().message();
  EXPECT_EQ(response.error().reason(), "QUOTA");
  EXPECT_EQ(response.error().limit(), "1");
  EXPECT_TRUE(response.error().has_retry_after());
  stream->WritesDone();
  EXPECT_OK(stream->Finish()) << "the stream goes on";
}

// Every call of the services of queries counts, before its request is looked at.
TEST_F(QuotaTest, CountsCallsOfAllServicesOfQueries) {
  v1::Quota quota;
  quota.set_queries_per_second(1);
  ASSERT_OK(Set(quota));
  ASSERT_OK(ListLabels());
  const char field[] = "queries_per_second";
  EXPECT_ERROR(Call(&SegmentationStub::SegmentViews, {}), grpc::UNAVAILABLE, field);
  EXPECT_ERROR(Call(&LabelStub::GetLabel, {}), grpc::UNAVAILABLE, field);
  EXPECT_ERROR(Call(&SelectionStub::GetSelection, {}), grpc::UNAVAILABLE, field);
  EXPECT_ERROR(Call(&RenderStub::RenderView, {}), grpc::UNAVAILABLE, field);
  EXPECT_ERROR(Call(&EvaluationStub::EvaluateModel, {}), grpc::UNAVAILABLE, field);
}

TEST_F(QuotaTest, LimitsModelsInMemory) {
  for (const char* scene : {"a", "b"}) TrainToTheEnd(scene, "file");
  ASSERT_OK(ListViews("a"));
  const int64_t of_one = Used().resident_bytes();
  ASSERT_GT(of_one, 0);
  v1::Quota quota;
  quota.set_resident_bytes(of_one * 3 / 2);
  ASSERT_OK(Set(quota));
  ASSERT_OK(ListViews("b")) << "the project's other model makes room";
  EXPECT_EQ(Used().resident_bytes(), of_one);
  quota.set_resident_bytes(of_one / 2);
  ASSERT_OK(Set(quota));
  EXPECT_OK(ListViews("b")) << "it is there";
  ExpectQuota(ListViews("a"), "resident_bytes");
}

TEST_F(QuotaTest, UsesTheServersValuesForProjectsWithoutQuota) {
  running.options.quota.open_uploads = 1;
  running.Restart();
  ASSERT_OK(Create("a", {{"1", "x"}}));
  ExpectQuota(Create("a", {{"1", "x"}}), "open_uploads");
  EXPECT_EQ(Usage().quota().open_uploads(), 1);
  v1::Quota quota;
  quota.set_open_uploads(5);
  ASSERT_OK(Set(quota));
  EXPECT_OK(Create("a", {{"1", "x"}}));
}

TEST_F(QuotaTest, RefusesBadQuotas) {
  v1::Quota quota;
  quota.set_running_jobs(-1);
  EXPECT_ERROR(Set(quota), grpc::INVALID_ARGUMENT, "quota.running_jobs");
  EXPECT_ERROR(Set({}, "No Label"), grpc::INVALID_ARGUMENT, "project");
  EXPECT_OK(Set({}, "new-project")) << "need not have a key";
}

}  // namespace
}  // namespace pepeseg
