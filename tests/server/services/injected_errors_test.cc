// What clients and the log see of errors of the database and of files.
#include <gmock/gmock.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "server/store/layout.h"
#include "server/store/soci.h"
#include "tests/server/shelf_model.h"
#include "tests/testing/time_limit.h"

namespace pepeseg {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

struct InjectedErrorsTest : ShelfModel {
  InjectedErrorsTest() : outer(spdlog::default_logger()) {
    const auto sink = std::make_shared<spdlog::sinks::ostream_sink_mt>(log);
    spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", sink));
    context.AddMetadata("x-request-id", kRequest);
  }
  ~InjectedErrorsTest() override { spdlog::set_default_logger(outer); }

  // A second connection to the server's database.
  void Spoil(const std::string& statement) const {
    soci::session sql(
        soci::sqlite3,
        absl::StrCat("dbname=\"", DatabasePath(running.options.data).string(), "\" timeout=10"));
    sql << statement;
  }
  void ExpectGeneral(const grpc::Status& status, grpc::StatusCode code) const {
    EXPECT_EQ(status.error_code(), code) << status.error_message();
    EXPECT_THAT(status.error_message(),
                AllOf(HasSubstr(kRequest), Not(HasSubstr("labels")), Not(HasSubstr("table")),
                      Not(HasSubstr(running.options.data.string()))));
    EXPECT_EQ(status.error_details().find(running.options.data.string()), std::string::npos);
  }
  std::string Log() const {
    spdlog::default_logger()->flush();
    return log.str();
  }

  static constexpr char kRequest[] = "request-of-a-test";
  grpc::ClientContext context;
  std::ostringstream log;
  std::shared_ptr<spdlog::logger> outer;
};

TEST_F(InjectedErrorsTest, KeepsTextsOfTheDatabaseInTheLog) {
  Spoil("ALTER TABLE labels RENAME TO no_labels");
  ExpectGeneral(CallWith(context, running.channel, &LabelStub::ListLabels, Under{"scenes/shelf"}),
                grpc::INTERNAL);
  EXPECT_THAT(Log(), AllOf(HasSubstr("no such table: labels"), HasSubstr(kRequest)));
}

TEST_F(InjectedErrorsTest, KeepsPathsOfTheServerInTheLog) {
  const TestFile file = {"images/1.jpg", "one"};
  const v1::Upload upload = running.CreateUpload("shelf", {file});
  ASSERT_OK(running.Write(FileParts(upload.name(), file)));
  const std::filesystem::path folder = DatasetsFolder(running.options.data);
  std::filesystem::remove_all(folder);
  std::ofstream(folder) << "in the way";
  ExpectGeneral(CallWith(context, running.channel, &DatasetStub::SealUpload, Named{upload.name()}),
                grpc::INTERNAL);
  EXPECT_THAT(Log(), AllOf(HasSubstr(folder.string()), HasSubstr(kRequest)));
}

TEST_F(InjectedErrorsTest, NamesADamagedModelByARelativePath) {
  const char* file = "jobs/j1/attempt-1/gaussians.ply";
  std::ofstream(running.options.data / file, std::ios::app) << "more than there was";
  const grpc::Status status =
      CallWith(context, running.channel, &SceneStub::ListViews, Under{kModel});
  EXPECT_ERROR(status, grpc::DATA_LOSS);
  EXPECT_THAT(status.error_message(),
              AllOf(HasSubstr(file), Not(HasSubstr(running.options.data.string()))));
  EXPECT_THAT(Log(), HasSubstr((running.options.data / file).string()));
}

TEST_F(InjectedErrorsTest, EndsAWatchWhoseJobsEndCannotBeWritten) {
  running.CreateScene("other");
  Spoil("ALTER TABLE models RENAME TO no_models");
  const v1::Job job = running.Train("other", "file");
  const absl::Time start = absl::Now();
  const auto stream = running.jobs->WatchJob(&context, Named{job.name()});
  v1::JobEvent event;
  while (stream->Read(&event)) EXPECT_FALSE(event.has_heartbeat());
  const grpc::Status status = stream->Finish();
  EXPECT_LT(absl::Now() - start, testing::TimeLimit(absl::Seconds(8)));
  EXPECT_ERROR(status, grpc::UNAVAILABLE, {.reason = "JOB_HELD_UP", .resource = job.name()});
  EXPECT_THAT(status.error_message(), AllOf(HasSubstr(job.name()), Not(HasSubstr("models"))));
  EXPECT_GT(DetailOf(status).retry_after().seconds(), 0);
  Spoil("ALTER TABLE no_models RENAME TO models");
  EXPECT_EQ(running.Await(job.name()).state(), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(InjectedErrorsTest, AppliesToAnswersOfAStream) {
  Spoil("ALTER TABLE models RENAME TO no_models");
  const auto stream = running.segmentation->StreamSegments(&context);
  v1::StreamSegmentsRequest request;
  request.mutable_segment()->set_model(kModel);
  ASSERT_TRUE(stream->Write(request));
  v1::StreamSegmentsResponse answer;
  ASSERT_TRUE(stream->Read(&answer));
  EXPECT_EQ(answer.error().code(), grpc::INTERNAL);
  EXPECT_EQ(answer.error().reason(), "INTERNAL");
  EXPECT_THAT(answer.error().message(), AllOf(HasSubstr(kRequest), Not(HasSubstr("models"))));
  stream->WritesDone();
  EXPECT_OK(stream->Finish());
  EXPECT_THAT(Log(), AllOf(HasSubstr("no such table: models"), HasSubstr(kRequest)));
}

}  // namespace
}  // namespace pepeseg
