// Streams of clients that have no key, send nothing, or read nothing.
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "absl/time/clock.h"
#include "tests/server/access/keyed_server.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr size_t kFewStreams = 4;

struct StreamLimitsTest : KeyedServer {
  StreamLimitsTest() {
    running.options.streams.max_streams = kFewStreams;
    running.options.streams.first_message = absl::Seconds(1);
    running.options.streams.stuck_export = absl::Seconds(1);
    running.Restart();
  }
  // A stream of an upload that has begun and sends nothing.
  struct Silent {
    std::unique_ptr<grpc::ClientContext> context;
    v1::WriteFilesResponse response;
    std::unique_ptr<grpc::ClientWriter<v1::WriteFilesRequest>> stream;
  };
  std::unique_ptr<Silent> BeginUpload(const std::string& secret) {
    auto silent = std::make_unique<Silent>();
    silent->context = With(secret);
    silent->stream = running.datasets->WriteFiles(silent->context.get(), &silent->response);
    return silent;
  }
};

TEST_F(StreamLimitsTest, RefusesCallersWithoutAKeyBeforeTheySendAnything) {
  std::vector<std::unique_ptr<Silent>> uploads;
  for (size_t i = 0; i < 5 * kFewStreams; ++i) {
    uploads.push_back(BeginUpload(i % 2 == 0 ? nobody : "pk_wrong"));
  }
  const auto watch_context = With(full);
  v1::WatchJobRequest watch;
  watch.set_name(job);
  const auto watcher = running.jobs->WatchJob(watch_context.get(), watch);
  v1::JobEvent event;
  EXPECT_TRUE(watcher->Read(&event));
  for (const auto& upload : uploads) {
    EXPECT_ERROR(upload->stream->Finish(), grpc::UNAUTHENTICATED);
  }
  while (watcher->Read(&event)) {
  }
  EXPECT_OK(watcher->Finish());
}

TEST_F(StreamLimitsTest, RefusesAKeyWithoutTheScopeAtOnce) {
  const auto upload = BeginUpload(reader);
  EXPECT_ERROR(upload->stream->Finish(), grpc::PERMISSION_DENIED, {.reason = "MISSING_SCOPE"});
}

TEST_F(StreamLimitsTest, EndsStreamsWithoutAFirstMessage) {
  const absl::Time start = absl::Now();
  const auto upload = BeginUpload(full);
  const auto context = With(full);
  const auto queries = running.segmentation->StreamSegments(context.get());
  v1::StreamSegmentsResponse answer;
  EXPECT_FALSE(queries->Read(&answer));
  for (const grpc::Status& status : {upload->stream->Finish(), queries->Finish()}) {
    EXPECT_ERROR(status, grpc::DEADLINE_EXCEEDED, {.reason = "TOO_SLOW"});
  }
  EXPECT_GE(absl::Now() - start, absl::Seconds(1));
  EXPECT_LT(absl::Now() - start, absl::Seconds(30));
}

TEST_F(StreamLimitsTest, EndsAnExportThatIsNotRead) {
  v1::ExportGaussiansRequest request;
  request.set_model("scenes/shelf/models/1");
  for (const bool is_subset : {false, true}) {
    if (is_subset) request.mutable_subset()->mutable_segment()->set_level(1);
    if (is_subset) request.mutable_subset()->mutable_segment()->set_id(2);
    const auto context = With(full);
    const absl::Time start = absl::Now();
    const auto stream = running.renders->ExportGaussians(context.get(), request);
    EXPECT_ERROR(stream->Finish(), grpc::CANCELLED);
    EXPECT_LT(absl::Now() - start, absl::Seconds(30)) << "until the client's own deadline";
  }
}

TEST_F(StreamLimitsTest, LetsStreamsPauseAfterTheFirstMessage) {
  const auto context = With(full);
  const auto queries = running.segmentation->StreamSegments(context.get());
  v1::StreamSegmentsRequest request;
  request.mutable_segment()->set_model("scenes/shelf/models/1");
  v1::StreamSegmentsResponse answer;
  for (int i = 1; i <= 2; ++i) {
    request.set_sequence(i);
    ASSERT_TRUE(queries->Write(request));
    ASSERT_TRUE(queries->Read(&answer));
    EXPECT_EQ(answer.sequence(), i);
    if (i == 1) absl::SleepFor(absl::Seconds(4));
  }
  queries->WritesDone();
  EXPECT_OK(queries->Finish());
}

}  // namespace
}  // namespace pepeseg
