#include "server/rpc/stream_registry.h"

#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "server/access/authorizer.h"
#include "server/rpc/stream.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

// A stream without a call, which waits until it is ended.
class IdleStream final : public Stream {
 public:
  IdleStream(StreamRegistry* registry, WorkerPool* pool) : Stream(registry, pool) {}
  using Stream::Admit;
  bool finished = false;

 private:
  Step Work(bool) override { return {Next::kIdle, absl::OkStatus()}; }
  void StartIo() override {}
  void FinishCall(const grpc::Status&) override { finished = true; }
  bool may_finish_during_io() const override { return true; }
};

struct StreamRegistryTest : ::testing::Test {
  std::shared_ptr<IdleStream> Open() {
    streams.push_back(std::make_shared<IdleStream>(&registry, &pool));
    registry.Add(streams.back());
    return streams.back();
  }
  absl::Status OpenFor(const StreamOwner& owner) { return Open()->Admit(owner); }
  ~StreamRegistryTest() override {
    for (const auto& stream : streams) registry.Remove(stream.get());
  }

  WorkerPool pool{{.threads = 1, .queued = 100}};
  StreamRegistry registry{absl::Seconds(60),
                          {/*max_streams=*/6, /*max_per_project=*/3,
                           /*max_per_peer=*/2, absl::Seconds(1), absl::Seconds(1)}};
  std::vector<std::shared_ptr<IdleStream>> streams;
};

TEST_F(StreamRegistryTest, LimitsProjectsPeersAndAll) {
  EXPECT_OK(OpenFor({"lab", "ipv4:10.0.0.1"}));
  EXPECT_OK(OpenFor({"lab", "ipv4:10.0.0.1"}));
  const absl::Status third_of_peer = OpenFor({"lab", "ipv4:10.0.0.1"});
  EXPECT_TRUE(absl::IsResourceExhausted(third_of_peer));
  EXPECT_EQ(third_of_peer.message(),
            "this client has 2 streams open, which is the limit; end some or try again later");
  EXPECT_OK(OpenFor({"lab", "ipv4:10.0.0.2"}));
  const absl::Status fourth_of_project = OpenFor({"lab", "ipv4:10.0.0.3"});
  EXPECT_TRUE(absl::IsResourceExhausted(fourth_of_project));
  EXPECT_TRUE(absl::StartsWith(fourth_of_project.message(), "the project has 3 streams"));
  // Another project may open streams until the limit for all is reached.
  for (int i = 0; i < 3; ++i) EXPECT_OK(OpenFor({"other", ""}));
  EXPECT_TRUE(absl::StartsWith(OpenFor({"", ""}).message(), "the server has 6 streams"));
  EXPECT_EQ(registry.num_refused(), 3);
}

TEST_F(StreamRegistryTest, AdmitsOthersWhenStreamsHaveEnded) {
  for (int i = 0; i < 100; ++i) {
    ASSERT_OK(OpenFor({"lab", "ipv4:10.0.0.1"})) << i;
    registry.Remove(streams.back().get());
  }
  EXPECT_EQ(registry.size(), 0u);
}

TEST_F(StreamRegistryTest, WarnsOnceWhenFourFifthsAreTaken) {
  std::ostringstream log;
  const auto outer = spdlog::default_logger();
  const auto sink = std::make_shared<spdlog::sinks::ostream_sink_mt>(log);
  spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", sink));
  for (int i = 0; i < 4; ++i) EXPECT_OK(OpenFor({"", ""}));
  spdlog::default_logger()->flush();
  EXPECT_EQ(log.str(), "") << "4 of 6";
  EXPECT_OK(OpenFor({"", ""}));
  EXPECT_OK(OpenFor({"", ""}));
  spdlog::default_logger()->flush();
  const std::string text = log.str();
  spdlog::set_default_logger(outer);
  EXPECT_TRUE(absl::StrContains(text, "streams: the server has 5 open, at 6 more are refused"))
      << text;
  EXPECT_FALSE(absl::StrContains(text, "has 6 open")) << "a line a minute: " << text;
}

// Streams of unknown callers do not count against the limits of known ones.
TEST_F(StreamRegistryTest, CountsStreamsOnceTheirCallerIsKnown) {
  std::vector<std::shared_ptr<IdleStream>> unknown;
  for (int i = 0; i < 4096; ++i) unknown.push_back(Open());
  EXPECT_FALSE(unknown.back()->finished);
  EXPECT_TRUE(Open()->finished);  // these are bounded, too
  registry.Remove(streams.back().get());
  registry.Remove(unknown[0].get());
  for (int i = 0; i < 3; ++i) {
    EXPECT_OK(OpenFor({"lab", ""}));
  }
  EXPECT_OK(unknown[1]->Admit({"other", ""}));
}

TEST(StreamOwner, IsTheProjectAndTheAddressOrSubject) {
  Caller caller;
  caller.project = "lab";
  StreamOwner owner = OwnerOf(caller, {"ipv4:10.0.0.1:50051", {}});
  EXPECT_EQ(owner.project, "lab");
  EXPECT_EQ(owner.peer, "ipv4:10.0.0.1");
  EXPECT_EQ(OwnerOf(caller, {"ipv6:%5B::1%5D:7", {}}).peer, "ipv6:%5B::1%5D");
  EXPECT_EQ(OwnerOf(caller, {"unix:/run/socket", {}}).peer, "");
  caller.subject = "ann";  // all of a gateway's callers have its address
  EXPECT_EQ(OwnerOf(caller, {"ipv4:10.0.0.1:50051", {}}).peer, "lab/ann");
  caller.sees_all_projects = true;
  EXPECT_EQ(OwnerOf(caller, {"ipv4:10.0.0.1:50051", {}}).project, "");
}

}  // namespace
}  // namespace pepeseg
