// Quotas, as callers and operators see them.
#include <gtest/gtest.h>

#include <functional>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/server/running_server.h"

namespace pepeseg {
namespace {

struct QuotaTest : ::testing::Test {
  QuotaTest() : running(PEPESEG_MODEL_WORKER, WithAdmin()) {
    for (const char* scene : {"a", "b"}) running.CreateScene(scene);
  }

  grpc::Status Set(const v1::Quota& quota, const std::string& project = "default") {
    grpc::ClientContext context;
    v1::UpdateQuotaRequest request;
    request.set_project(project);
    *request.mutable_quota() = quota;
    return running.admin->UpdateQuota(&context, request, &usage);
  }
  v1::Quota Used() {
    grpc::ClientContext context;
    v1::GetProjectUsageRequest request;
    request.set_project("default");
    EXPECT_TRUE(running.admin->GetProjectUsage(&context, request, &usage).ok());
    return usage.used();
  }
  grpc::Status Create(const std::string& scene, const std::vector<TestFile>& files) {
    grpc::ClientContext context;
    v1::CreateUploadRequest request;
    request.set_parent("scenes/" + scene);
    for (const TestFile& file : files) *request.add_files() = Declare(file);
    v1::Upload upload;
    return running.datasets->CreateUpload(&context, request, &upload);
  }
  grpc::Status Train(const std::string& scene, const std::string& dataset) {
    grpc::ClientContext context;
    v1::TrainSceneRequest request;
    request.set_scene("scenes/" + scene);
    request.set_dataset(dataset);
    v1::Job job;
    return running.jobs->TrainScene(&context, request, &job);
  }
  grpc::Status ListViews(const std::string& scene) {
    grpc::ClientContext context;
    v1::ListViewsRequest request;
    request.set_parent(absl::StrCat("scenes/", scene, "/models/live"));
    v1::ListViewsResponse response;
    return running.scenes->ListViews(&context, request, &response);
  }
  grpc::Status ListLabels() {
    grpc::ClientContext context;
    v1::ListLabelsRequest request;
    request.set_parent("scenes/a");
    v1::ListLabelsResponse response;
    return running.labels->ListLabels(&context, request, &response);
  }
  static void ExpectQuota(const grpc::Status& status, const std::string& name) {
    EXPECT_EQ(status.error_code(), grpc::RESOURCE_EXHAUSTED) << status.error_message();
    EXPECT_EQ(DetailOf(status).reason(), "QUOTA");
    EXPECT_EQ(DetailOf(status).field(), name);
    EXPECT_FALSE(DetailOf(status).value().empty() || DetailOf(status).limit().empty());
  }

  RunningServer running;
  v1::ProjectUsage usage;
};

TEST_F(QuotaTest, LimitsBytesAndOpenUploads) {
  v1::Quota quota;
  quota.set_stored_bytes(10);
  ASSERT_TRUE(Set(quota).ok());
  EXPECT_EQ(usage.quota().stored_bytes(), 10);
  ExpectQuota(Create("a", {{"1", "elevenbytes"}}), "stored_bytes");
  running.UploadAndSeal("a", {{"1", "tenletters"}});
  EXPECT_EQ(Used().stored_bytes(), 10);
  EXPECT_TRUE(Create("b", {{"other name", "tenletters"}}).ok()) << "is there already";
  quota.set_open_uploads(1);
  ASSERT_TRUE(Set(quota).ok());
  EXPECT_EQ(usage.used().open_uploads(), 1);
  ExpectQuota(Create("a", {{"1", "tenletters"}}), "open_uploads");
}

// Partial files whose digest no dataset has, and deleted files that the collector has not removed.
TEST_F(QuotaTest, CountsStoredBytesThatAreNotInADataset) {
  v1::Quota quota;
  quota.set_stored_bytes(20);
  ASSERT_TRUE(Set(quota).ok());
  const TestFile file{"1", "tenletters"};
  ASSERT_TRUE(Create("a", {file}).ok());
  running.Write({HeaderPart("scenes/a/uploads/1", "1"), ChunkPart("tenlett")});
  ASSERT_TRUE(Create("b", {file}).ok());
  ExpectQuota(Create("b", {file}), "stored_bytes");
}

TEST_F(QuotaTest, CountsModelsAndSelectionsAsStoredBytes) {
  ASSERT_EQ(running.Await(running.Train("a", "file").name()).state(), v1::JOB_STATE_SUCCEEDED);
  grpc::ClientContext context, deletion;
  v1::GetModelRequest request;
  request.set_name("scenes/a/models/live");
  v1::Model model;
  ASSERT_TRUE(running.scenes->GetModel(&context, request, &model).ok());
  const int64_t used = Used().stored_bytes();
  EXPECT_GT(used, 5) << "the bytes of the file";
  v1::Quota quota;
  quota.set_stored_bytes(used);
  ASSERT_TRUE(Set(quota).ok());
  ExpectQuota(Train("a", "scenes/a/datasets/1"), "stored_bytes");
  v1::DeleteModelRequest request_deletion;
  request_deletion.set_name(model.name());
  google::protobuf::Empty empty;
  ASSERT_TRUE(running.scenes->DeleteModel(&deletion, request_deletion, &empty).ok());
  EXPECT_EQ(Used().stored_bytes(), 5);
  EXPECT_TRUE(Train("a", "scenes/a/datasets/1").ok());
}

TEST_F(QuotaTest, LimitsQueuedJobs) {
  const std::string a = running.UploadAndSeal("a", {{"hang", "bytes"}});
  const std::string b = running.UploadAndSeal("b", {{"hang", "bytes"}});
  running.CreateScene("c");
  const std::string c = running.UploadAndSeal("c", {{"hang", "bytes"}});
  v1::Quota quota;
  quota.set_queued_jobs(1);
  ASSERT_TRUE(Set(quota).ok());
  ASSERT_TRUE(Train("a", a).ok());
  while (Used().running_jobs() == 0) absl::SleepFor(absl::Milliseconds(5));
  ASSERT_TRUE(Train("b", b).ok()) << "waits for the one slot";
  EXPECT_EQ(Used().queued_jobs(), 1);
  ExpectQuota(Train("c", c), "queued_jobs");
}

TEST_F(QuotaTest, LimitsQueries) {
  v1::Quota quota;
  quota.set_queries_per_second(2);
  ASSERT_TRUE(Set(quota).ok());
  int num_refused = 0;
  grpc::Status refused;
  for (int i = 0; i < 8; ++i) {
    const grpc::Status status = ListLabels();
    if (status.ok()) continue;
    ++num_refused;
    refused = status;
  }
  EXPECT_GE(num_refused, 4);
  EXPECT_EQ(refused.error_code(), grpc::UNAVAILABLE) << refused.error_message();
  EXPECT_EQ(DetailOf(refused).reason(), "QUOTA");
  EXPECT_EQ(DetailOf(refused).field(), "queries_per_second");
  EXPECT_TRUE(DetailOf(refused).has_retry_after());
  EXPECT_GE(Used().queries_per_second(), 1);
  ASSERT_TRUE(Set({}).ok());
  for (int i = 0; i < 8; ++i) EXPECT_TRUE(ListLabels().ok());
}

TEST_F(QuotaTest, LimitsQueriesOfAStream) {
  v1::Quota quota;
  quota.set_queries_per_second(1);
  ASSERT_TRUE(Set(quota).ok());
  ASSERT_TRUE(ListLabels().ok());
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
  EXPECT_TRUE(stream->Finish().ok()) << "the stream goes on";
}

// Every call of the services of queries counts, before its request is looked at.
TEST_F(QuotaTest, CountsCallsOfAllServicesOfQueries) {
  using Call = std::function<grpc::Status(grpc::ClientContext*)>;
  v1::SegmentViewsResponse segments;
  v1::Label label;
  v1::Selection selection;
  v1::RenderViewResponse picture;
  v1::EvaluateModelResponse scores;
  const std::vector<Call> calls = {
      [&](auto* context) { return running.segmentation->SegmentViews(context, {}, &segments); },
      [&](auto* context) { return running.labels->GetLabel(context, {}, &label); },
      [&](auto* context) { return running.selections->GetSelection(context, {}, &selection); },
      [&](auto* context) { return running.renders->RenderView(context, {}, &picture); },
      [&](auto* context) { return running.evaluations->EvaluateModel(context, {}, &scores); }};
  v1::Quota quota;
  quota.set_queries_per_second(1);
  ASSERT_TRUE(Set(quota).ok());
  ASSERT_TRUE(ListLabels().ok());
  for (const Call& call : calls) {
    grpc::ClientContext context;
    const grpc::Status refused = call(&context);
    EXPECT_EQ(refused.error_code(), grpc::UNAVAILABLE) << refused.error_message();
    EXPECT_EQ(DetailOf(refused).field(), "queries_per_second");
  }
}

TEST_F(QuotaTest, LimitsModelsInMemory) {
  for (const char* scene : {"a", "b"}) {
    ASSERT_EQ(running.Await(running.Train(scene, "file").name()).state(), v1::JOB_STATE_SUCCEEDED);
  }
  ASSERT_TRUE(ListViews("a").ok());
  const int64_t of_one = Used().resident_bytes();
  ASSERT_GT(of_one, 0);
  v1::Quota quota;
  quota.set_resident_bytes(of_one * 3 / 2);
  ASSERT_TRUE(Set(quota).ok());
  ASSERT_TRUE(ListViews("b").ok()) << "the project's other model makes room";
  EXPECT_EQ(Used().resident_bytes(), of_one);
  quota.set_resident_bytes(of_one / 2);
  ASSERT_TRUE(Set(quota).ok());
  EXPECT_TRUE(ListViews("b").ok()) << "it is there";
  ExpectQuota(ListViews("a"), "resident_bytes");
}

TEST_F(QuotaTest, UsesTheServersValuesForProjectsWithoutQuota) {
  running.options.quota.open_uploads = 1;
  running.Restart();
  ASSERT_TRUE(Create("a", {{"1", "x"}}).ok());
  ExpectQuota(Create("a", {{"1", "x"}}), "open_uploads");
  Used();
  EXPECT_EQ(usage.quota().open_uploads(), 1);
  v1::Quota quota;
  quota.set_open_uploads(5);
  ASSERT_TRUE(Set(quota).ok());
  EXPECT_TRUE(Create("a", {{"1", "x"}}).ok());
}

TEST_F(QuotaTest, RefusesBadQuotas) {
  v1::Quota quota;
  quota.set_running_jobs(-1);
  grpc::Status status = Set(quota);
  EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(DetailOf(status).field(), "quota.running_jobs");
  status = Set({}, "No Label");
  EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(DetailOf(status).field(), "project");
  EXPECT_TRUE(Set({}, "new-project").ok()) << "need not have a key";
}

}  // namespace
}  // namespace pepeseg
