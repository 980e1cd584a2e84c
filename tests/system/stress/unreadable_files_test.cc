// A disk that cannot read a file: each kind of file that a server reads when it starts or answers,
// one after the other. Calls that need the file fail, and the others have the same answers as
// before.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iostream>
#include <map>
#include <set>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/base/status_macros.h"
#include "server/store/layout.h"
#include "server/store/soci.h"
#include "tests/server/pepesegd_process.h"
#include "tests/server/service_client.h"
#include "tests/system/stress/io_fault_lives.h"
#include "tests/system/stress/life_of_a_scene.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using testing::PepesegdProcess;
using testing::ServiceClient;

// By name of the call, its answer: a digest, or the error.
using Answers = std::map<std::string, absl::StatusOr<std::string>>;

template <typename T>
absl::StatusOr<std::string> Reported(const absl::StatusOr<T>& answer) {
  if (!answer.ok()) return answer.status();
  return answer->DebugString();  // bytes of a map have any order
}

// Returns the kind of a path: files whose names differ only in numbers have the same kind.
std::string KindOf(const std::string& path) {
  std::string kind;
  for (const char c : path) {
    if (!absl::ascii_isdigit(c)) kind += c;
    if (absl::ascii_isdigit(c) && (kind.empty() || kind.back() != '#')) kind += '#';
  }
  return kind;
}

class UnreadableFiles : public ::testing::Test {
 protected:
  UnreadableFiles() {
    PepesegdProcess server(data_, Options({}));
    EXPECT_OK(life_.Run(server.channel()));
    ServiceClient client(server.channel());
    EXPECT_OK(client.CreateScene("shelf"));
    dataset_ = client.Upload("shelf", Shelf()).value_or("");
    EXPECT_NE(dataset_, "");
    server.Terminate();
  }

  static testing::PepesegdOptions Options(std::vector<std::string> environment) {
    // The machine's free memory differs in each estimate.
    return {{"--device-memory=4GB"},
            std::move(environment),
            PEPESEG_MODEL_WORKER,
            "",
            /*may_end=*/true};
  }

  // Makes the dataset like one whose bytes were there before its upload: an estimate reads the
  // headers of its files.
  void ForgetHeaders() const {
    soci::session sql(soci::sqlite3, absl::StrCat("dbname=\"", DatabasePath(data_).string(), "\""));
    sql << "UPDATE dataset_files SET header = 0, width = 0, height = 0, num_points = 0";
  }

  // Returns those files of a dataset that an estimate reads.
  static std::vector<testing::ClientFile> Shelf() {
    std::vector<testing::ClientFile> files = testing::ReadDataset(PEPESEG_TEST_DATA "/apc_shelf");
    std::erase_if(files, [](const testing::ClientFile& file) {
      return file.kind != v1::FILE_KIND_POSES && !absl::EndsWith(file.path, "000000.jpg");
    });
    files.push_back({"points.ply", v1::FILE_KIND_POINTS,
                     "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
                     "property float z\nend_header\n0 0 0\n"});
    return files;
  }

  absl::StatusOr<std::string> ExportSelected(const std::shared_ptr<grpc::Channel>& channel) const {
    const auto stub = v1::RenderService::NewStub(channel);
    grpc::ClientContext context;
    v1::ExportGaussiansRequest request;
    request.set_model(life_.model());
    request.mutable_subset()->set_selection(life_.selection());
    const auto stream = stub->ExportGaussians(&context, request);
    std::string ply;
    for (v1::ExportGaussiansResponse part; stream->Read(&part);) ply += part.chunk();
    const grpc::Status status = stream->Finish();
    if (status.ok()) return Sha256Hex(ply);
    return absl::Status(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
  }

  static absl::StatusOr<std::string> Events(ServiceClient& client, const std::string& job) {
    ASSIGN_OR_RETURN(const std::vector<v1::JobEvent> events, client.Watch(job));
    std::string all;
    for (const v1::JobEvent& event : events) {
      if (!event.has_snapshot()) all += event.SerializeAsString();
    }
    return all;
  }

  Answers AskAll(const std::shared_ptr<grpc::Channel>& channel) {
    ServiceClient client(channel);
    Answers answers;
    const absl::Status checked = life_.Check(channel);
    answers.emplace("check", checked.ok() ? absl::StatusOr<std::string>("") : checked);
    EXPECT_FALSE(life_.found_wrong()) << checked;
    answers.emplace("job", Reported(client.GetJob(life_.job())));
    answers.emplace("events", Events(client, life_.job()));
    answers.emplace("model", Reported(client.GetModel(life_.model())));
    answers.emplace("render", client.Render(life_.model(), "middle.jpg").status().ok()
                                  ? absl::StatusOr<std::string>("drawn")
                                  : client.Render(life_.model(), "middle.jpg").status());
    answers.emplace("export", client.Export(life_.model()));
    answers.emplace("export of a selection", ExportSelected(channel));
    answers.emplace("estimate", Reported(client.Estimate("scenes/shelf", dataset_, {})));
    return answers;
  }

  // Returns the server's answers under these faults; nothing if it did not start.
  std::optional<Answers> Serve(std::vector<std::string> faults) {
    ForgetHeaders();
    std::vector<std::string> environment = FaultEnvironment(data_, "");
    environment.insert(environment.end(), faults.begin(), faults.end());
    PepesegdProcess server(data_, Options(environment));
    if (!server.alive()) {
      EXPECT_THAT(server.Log(), ::testing::HasSubstr("cannot start"));
      return std::nullopt;
    }
    Answers answers = AskAll(server.channel());
    EXPECT_TRUE(server.alive()) << server.Log();
    const auto end = server.Terminate();
    EXPECT_TRUE(end.has_value() && end->signal == 0) << server.Log();
    return answers;
  }

  // Returns a file of each kind, relative to the data directory.
  std::map<std::string, std::string> FindKinds() {
    const std::filesystem::path trace = folder_ / "trace";
    const auto answers = Serve({"PEPESEG_FAULT_TRACE=" + trace.string()});
    std::map<std::string, std::string> kinds;
    for (const std::string& path : TracedPaths(trace, {"read"})) {
      const std::string name = path.substr(data_.string().size());
      // Each blob counts as its own kind.
      kinds.emplace(absl::StartsWith(name, "/blobs/") ? name : KindOf(name), name);
    }
    return kinds;
  }

  const testing::TempFolder folder_;
  const std::filesystem::path data_ = folder_ / "data";
  LifeOfAScene life_{"first"};
  std::string dataset_;
};

TEST_F(UnreadableFiles, FailOnlyTheRequestsThatNeedThem) {
  const std::map<std::string, std::string> kinds = FindKinds();
  const std::optional<Answers> healthy = Serve({});
  ASSERT_TRUE(healthy.has_value());
  for (const auto& [call, answer] : *healthy) EXPECT_OK(answer) << call;
  std::set<std::string> needed;  // kinds of files
  for (const auto& [kind, name] : kinds) {
    SCOPED_TRACE(name);
    const auto answers = Serve({"PEPESEG_FAULT=unreadable-from:1", "PEPESEG_FAULT_FILE=" + name});
    std::string reported = answers.has_value() ? "" : "does not start";
    for (const auto& [call, answer] : answers.value_or(Answers())) {
      if (answer.ok()) {
        EXPECT_EQ(*answer, *healthy->at(call)) << call;
        continue;
      }
      EXPECT_TRUE(absl::IsInternal(answer.status()) || absl::IsDataLoss(answer.status()))
          << call << ": " << answer.status();
      absl::StrAppend(&reported, reported.empty() ? "" : ", ", call, ": ",
                      absl::StatusCodeToString(answer.status().code()));
    }
    std::cout << name << ": " << (reported.empty() ? "nobody needs it" : reported) << "\n";
    if (!reported.empty()) needed.insert(kind);
  }
  EXPECT_THAT(needed, ::testing::IsSupersetOf(std::vector<std::string>{
                          "/pepeseg.db", "/selections/#/#", "/jobs/j#/events-#.log",
                          "/jobs/j#/attempt-#/manifest.json", "/jobs/j#/attempt-#/model.json",
                          "/jobs/j#/attempt-#/gaussians.ply", "/jobs/j#/attempt-#/features.bin"}));
  EXPECT_THAT(needed, ::testing::Contains(::testing::StartsWith("/blobs/")));
  // Without faults, the answers are the same as before.
  const std::optional<Answers> after = Serve({});
  ASSERT_TRUE(after.has_value());
  for (const auto& [call, answer] : *after) EXPECT_EQ(answer, healthy->at(call)) << call;
}

}  // namespace
}  // namespace pepeseg
