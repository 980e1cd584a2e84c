// Measures the cost of the gateway against direct calls to the server.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdio>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/digest.h"
#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "tests/server/service_client.h"
#include "tests/system/gateway/fleet.h"
#include "tests/system/gateway/from_environment.h"
#include "tests/system/gateway/steady_load.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::testing {
namespace {

// One server. Its data are on a file system in memory, if there is one.
struct OneServer : ::testing::Test {
  OneServer() : fleet(Options()) {}
  ~OneServer() override { std::filesystem::remove_all(in_memory); }
  FleetOptions Options() const {
    FleetOptions options;
    options.data = in_memory / "data";
    options.worker = PEPESEG_MODEL_WORKER;
    options.gateway_environment = {"PEPESEG_CALLS=1000000", "PEPESEG_GATEWAY_THREADS=1"};
    return options;
  }
  static std::filesystem::path NewFolder() {
    std::string pattern = std::filesystem::is_directory("/dev/shm") ? "/dev/shm/pepeseg.XXXXXX"
                                                                    : "/tmp/pepeseg.XXXXXX";
    return mkdtemp(pattern.data());
  }
  std::string Token() const {
    return fleet.issuer.Sign(TokenIssuer::Claims("lab", "read write train"));
  }
  std::string DirectKey() const {
    return fleet.MakeKey("lab", {v1::SCOPE_READ, v1::SCOPE_WRITE, v1::SCOPE_TRAIN});
  }

  const std::filesystem::path in_memory = NewFolder();
  Fleet fleet;
};

// Returns the bytes per second at which one file is uploaded. Its bytes are made as they are sent.
double UploadRate(const std::shared_ptr<grpc::Channel>& channel, const std::string& scene,
                  int64_t num_chunks, uint8_t fill) {
  ServiceClient client(channel);
  EXPECT_OK(client.CreateScene(scene));
  std::string chunk(1 << 20, static_cast<char>(fill));
  Sha256 digest;
  for (int64_t i = 0; i < num_chunks; ++i) digest.Add(chunk);
  const auto datasets = v1::DatasetService::NewStub(channel);
  v1::CreateUploadRequest create;
  create.set_parent("scenes/" + scene);
  v1::FileDeclaration& file = *create.add_files();
  file.set_path("a.jpg");
  file.set_kind(v1::FILE_KIND_IMAGE);
  file.set_size(num_chunks << 20);
  file.set_sha256(digest.Hex());
  grpc::ClientContext create_context;
  v1::Upload upload;
  EXPECT_OK(datasets->CreateUpload(&create_context, create, &upload));
  const absl::Time start = absl::Now();
  grpc::ClientContext context;
  context.AddMetadata("x-scene", scene);
  v1::WriteFilesResponse response;
  const auto stream = datasets->WriteFiles(&context, &response);
  v1::WriteFilesRequest part;
  part.mutable_header()->set_upload(upload.name());
  part.mutable_header()->set_path("a.jpg");
  stream->Write(part);
  part.set_chunk(chunk);
  for (int64_t i = 0; i < num_chunks; ++i) {
    if (!stream->Write(part)) break;
  }
  part.mutable_end();
  stream->Write(part);
  stream->WritesDone();
  EXPECT_OK(stream->Finish());
  return static_cast<double>(num_chunks << 20) / absl::ToDoubleSeconds(absl::Now() - start);
}

TEST_F(OneServer, UploadsThroughTheGatewayHardlySlower) {
  const auto num_chunks = static_cast<int64_t>(FromEnvironment("PEPESEG_GATEWAY_MIB", 1024));
  const std::string key = DirectKey();
  std::vector<double> direct, through;
  for (int round = 0; round < 3; ++round) {
    const auto fill = static_cast<uint8_t>(2 * round);
    direct.push_back(
        UploadRate(fleet.ConnectDirectly(0, key), absl::StrCat("direct", round), num_chunks, fill));
    through.push_back(
        UploadRate(fleet.Connect(Token()), absl::StrCat("through", round), num_chunks, fill + 1));
  }
  std::sort(direct.begin(), direct.end());
  std::sort(through.begin(), through.end());
  printf("%ld MiB: direct %.0f MB/s, through the gateway %.0f MB/s, %.0f %% (medians of 3)\n",
         num_chunks, direct[1] / 1e6, through[1] / 1e6, 100 * through[1] / direct[1]);
  EXPECT_GE(through[1], 0.7 * direct[1]);
}

TEST_F(OneServer, AnswersThroughTheGatewayHardlySlower) {
  ServiceClient client(fleet.Connect(Token()));
  ASSERT_OK(client.CreateScene("s0"));
  ASSERT_OK_AND_ASSIGN(const std::string dataset,
                       client.Upload("s0", {{"file", v1::FILE_KIND_IMAGE, "x"}}));
  ASSERT_OK_AND_ASSIGN(const v1::Job job, client.Train("s0", dataset, {}));
  ASSERT_OK(client.WaitForJob(job.name()));
  const auto ask = [](v1::SegmentationService::Stub& stub) {
    const v1::SegmentViewsRequest request = SteadyLoad::SmallQuery("s0");
    grpc::ClientContext context;
    context.AddMetadata("x-scene", "s0");
    v1::SegmentViewsResponse response;
    const absl::Time start = absl::Now();
    EXPECT_OK(stub.SegmentViews(&context, request, &response));
    return absl::Now() - start;
  };
  const auto direct = v1::SegmentationService::NewStub(fleet.ConnectDirectly(0, DirectKey()));
  const auto through = v1::SegmentationService::NewStub(fleet.Connect(Token()));
  const auto by_key = v1::SegmentationService::NewStub(fleet.Connect(DirectKey()));
  std::vector<absl::Duration> direct_took, through_took, key_took;
  for (int i = 0; i < 3000; ++i) {  // alternates, so that other load on the machine affects both
    const absl::Duration d = ask(*direct), t = ask(*through), k = ask(*by_key);
    if (i < 100) continue;
    direct_took.push_back(d);
    through_took.push_back(t);
    key_took.push_back(k);
  }
  const auto p50 = [](std::vector<absl::Duration>& took) {
    std::sort(took.begin(), took.end());
    return took[took.size() / 2];
  };
  const absl::Duration d = p50(direct_took), t = p50(through_took), k = p50(key_took);
  printf("p50: direct %s; through the gateway with a JWT %s (+%s), with a key %s (+%s)\n",
         absl::FormatDuration(d).c_str(), absl::FormatDuration(t).c_str(),
         absl::FormatDuration(t - d).c_str(), absl::FormatDuration(k).c_str(),
         absl::FormatDuration(k - d).c_str());
  // Half of a direct call, on machines that are slower than that of deploy/gateway/README.md.
  const absl::Duration limit = std::max(absl::Microseconds(300), d / 2);
  EXPECT_LE(t - d, limit);
  EXPECT_LE(k - d, limit);
}

}  // namespace
}  // namespace pepeseg::testing
