// More connections than the server program has file descriptors. It must serve new clients as soon
// as it can; if it cannot, it must end so that it is restarted.
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/server/pepesegd_process.h"
#include "tests/server/service_client.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

constexpr rlim_t kFewDescriptors = 256;
constexpr int kNumMute = 400;

// TCP connections that never send a byte.
class MuteConnections {
 public:
  MuteConnections(int port, int count) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    for (int i = 0; i < count; ++i) {
      sockets_.push_back(socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
      EXPECT_GE(sockets_.back(), 0);
      connect(sockets_.back(), reinterpret_cast<sockaddr*>(&address), sizeof(address));
    }
  }
  ~MuteConnections() { Close(); }
  MuteConnections(const MuteConnections&) = delete;
  MuteConnections& operator=(const MuteConnections&) = delete;
  void Close() {
    for (const int socket : std::exchange(sockets_, {})) close(socket);
  }

 private:
  std::vector<int> sockets_;
};

struct DescriptorShortage : ::testing::Test {
  explicit DescriptorShortage(std::vector<std::string> arguments = {})
      : server(folder / "data",
               {std::move(arguments), {}, PEPESEG_MODEL_WORKER, "", /*may_end=*/false}),
        client(server.channel()) {
    std::ifstream(absl::StrCat((folder / "data").string(), ".port")) >> port;
    EXPECT_OK(client.CreateScene("before"));
  }
  // Sets the limit of the running server, which reads it again with each connection.
  void LimitDescriptors(rlim_t limit) {
    const rlimit few = {limit, limit};
    ASSERT_EQ(prlimit(server.pid(), RLIMIT_NOFILE, &few, nullptr), 0);
  }
  // Returns whether a client that connects now is answered within `patience`.
  bool ServesNewClient(absl::Duration patience) const {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 200);
    const auto channel = grpc::CreateCustomChannel(absl::StrCat("127.0.0.1:", port),
                                                   grpc::InsecureChannelCredentials(), arguments);
    return channel->WaitForConnected(absl::ToChronoTime(absl::Now() + patience)) &&
           absl::IsNotFound(testing::ServiceClient(channel).GetJob("jobs/j999").status());
  }

  const testing::TempFolder folder;
  testing::PepesegdProcess server;
  testing::ServiceClient client;
  int port = 0;
};

TEST(DescriptorLimit, IsRaisedToTheHardLimit) {
  rlimit own{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &own), 0);
  const rlimit low = {std::min<rlim_t>(512, own.rlim_max), own.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &low), 0);
  const testing::TempFolder folder;
  const testing::PepesegdProcess server(folder / "data");
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &own), 0);
  rlimit raised{};
  ASSERT_EQ(prlimit(server.pid(), RLIMIT_NOFILE, nullptr, &raised), 0);
  EXPECT_EQ(raised.rlim_cur, std::min<rlim_t>(own.rlim_max, 1 << 20));
  EXPECT_EQ(absl::StrContains(server.Log(), "the limit on open files is"), own.rlim_max < 8192);
}

// Lowers the hard limit of this process permanently. 2,048 are enough for the tests after it.
TEST(DescriptorLimit, WarnsOfALowHardLimit) {
  rlimit own{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &own), 0);
  const rlim_t limit = std::min<rlim_t>(2048, own.rlim_max);
  const rlimit low = {limit, limit};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &low), 0);
  const testing::TempFolder folder;
  const testing::PepesegdProcess server(folder / "data");
  EXPECT_TRUE(absl::StrContains(server.Log(), absl::StrCat("the limit on open files is ", limit)))
      << server.Log();
}

TEST_F(DescriptorShortage, ServesNewClientsAfterABurstOfMuteConnections) {
  LimitDescriptors(kFewDescriptors);
  MuteConnections mute(port, kNumMute);
  absl::SleepFor(absl::Seconds(2));
  // Connected clients are served, also with files.
  EXPECT_OK(client.CreateScene("during"));
  mute.Close();
  EXPECT_TRUE(ServesNewClient(absl::Seconds(20))) << server.Log();
  EXPECT_TRUE(server.alive());
  EXPECT_TRUE(absl::StrContains(server.Log(), "new connections refused")) << server.Log();
}

TEST_F(DescriptorShortage, ClosesMuteConnections) {
  LimitDescriptors(kFewDescriptors);
  const MuteConnections mute(port, kNumMute);
  // The limit for a handshake is 10 s.
  EXPECT_TRUE(ServesNewClient(absl::Seconds(40))) << server.Log();
}

struct ProbedServer : DescriptorShortage {
  ProbedServer() : DescriptorShortage({"--self-probe-seconds=1"}) {}
};

TEST_F(ProbedServer, ReachesItselfWhileClientsAreRefused) {
  LimitDescriptors(kFewDescriptors);
  const MuteConnections mute(port, kNumMute);
  absl::SleepFor(absl::Seconds(6));
  EXPECT_TRUE(server.alive()) << server.Log();
  EXPECT_FALSE(absl::StrContains(server.Log(), "self-probe")) << server.Log();
}

TEST_F(ProbedServer, ExitsForARestartThatJobsSurvive) {
  const auto dataset = client.Upload("before", {{"hang", v1::FILE_KIND_IMAGE, "bytes"}});
  ASSERT_OK(dataset);
  const auto job = client.Train("before", *dataset, {});
  ASSERT_OK(job);
  const std::string word = "--job=" + (folder / "data" / job->name()).string();
  ASSERT_TRUE(testing::Eventually([&] { return testing::FindProcess(word) != 0; }));
  // The limit is below the number of open files: no connection can be accepted, and no file opened.
  LimitDescriptors(3);
  ASSERT_TRUE(testing::Eventually([&] { return !server.alive(); }, absl::Seconds(40)))
      << server.Log();
  const auto end = server.Terminate();  // it has ended; returns only its status
  ASSERT_TRUE(end.has_value());
  EXPECT_EQ(end->exit_code, 1) << end->description;
  std::ifstream log(absl::StrCat((folder / "data").string(), ".log"));
  EXPECT_TRUE(absl::StrContains(std::string(std::istreambuf_iterator<char>(log), {}),
                                "it must be restarted"))
      << server.Log();

  testing::PepesegdProcess again(folder / "data", {{}, {}, PEPESEG_MODEL_WORKER, "2", false});
  const auto resumed = testing::ServiceClient(again.channel()).GetJob(job->name());
  ASSERT_OK(resumed);
  EXPECT_TRUE(resumed->state() == v1::JOB_STATE_QUEUED || resumed->state() == v1::JOB_STATE_RUNNING)
      << resumed->DebugString();
}

}  // namespace
}  // namespace pepeseg
