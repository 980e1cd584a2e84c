// Sends to the gateway what tests/system/stress/http2_abuse_test.cc sends to the server. Gateway
// and server stay alive, other clients are answered meanwhile, and memory stays bounded.
#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iostream>

#include "absl/functional/function_ref.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/system/gateway/gateway_fixture.h"
#include "tests/system/stress/http2_connection.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/time_limit.h"

namespace pepeseg::testing {
namespace {

using http2::CallHeaders, http2::Connection, http2::Frame, http2::Header, http2::kPreface;
using enum http2::FrameType;
using enum http2::Flags;

constexpr int64_t kMiB = int64_t{1} << 20;

class AbuseOfGateway : public GatewayTest {
 protected:
  void SetUp() override {
    GatewayTest::SetUp();
    if (IsSkipped()) return;
    auto claims = TokenIssuer::Claims("lab", "read");
    claims["sub"] = "bystander";
    bystander_ = fleet().Connect(fleet().issuer.Sign(claims));
    EXPECT_OK(List(bystander_));
    gateway_before_ = Rss(fleet().gateway().pid());
    server_before_ = Rss(fleet().server(0).pid());
  }
  static int64_t Rss(pid_t process) {
    int64_t pages = 0;
    std::ifstream(absl::StrCat("/proc/", process, "/statm")) >> pages >> pages;
    return pages * sysconf(_SC_PAGESIZE);
  }
  static std::unique_ptr<Connection> Open() {
    auto connection = std::make_unique<Connection>(fleet().gateway_port(), Connection::Kind::kTls);
    connection->Send(std::string(kPreface) + Frame(kSettings, kNone, 0, ""));
    return connection;
  }
  // Waits up to ten seconds.
  static ::testing::AssertionResult Await(absl::FunctionRef<bool()> is_so) {
    return testing::Eventually(is_so, absl::Seconds(10));
  }
  // Calls over a connection that existed before, and over a new one.
  void ExpectServing(const char* what) {
    const absl::Time start = absl::Now();
    EXPECT_EQ(TextOf(List(bystander_)), "OK: ") << what;
    EXPECT_EQ(TextOf(List(Token())), "OK: ") << what;
    const absl::Duration took = absl::Now() - start;
    const int64_t gateway = Rss(fleet().gateway().pid()) - gateway_before_;
    const int64_t server = Rss(fleet().server(0).pid()) - server_before_;
    std::cout << what << ": answered in " << absl::FormatDuration(took) << ", gateway +"
              << gateway / kMiB << " MiB, server +" << server / kMiB << " MiB\n";
    EXPECT_FALSE(fleet().gateway().Poll().has_value());
    EXPECT_TRUE(fleet().server(0).alive());
    EXPECT_LT(took, testing::TimeLimit(absl::Seconds(2))) << what;
    EXPECT_LT(gateway, 256 * kMiB) << what;
    EXPECT_LT(server, 64 * kMiB) << what;
  }

  std::shared_ptr<grpc::Channel> bystander_;
  int64_t gateway_before_ = 0, server_before_ = 0;
};

TEST_F(AbuseOfGateway, EndsConnectionsThatSendAByteAtATime) {
  std::vector<std::unique_ptr<Connection>> silent, slow;
  for (int i = 0; i < 200; ++i) {
    silent.push_back(std::make_unique<Connection>(fleet().gateway_port()));
    slow.push_back(std::make_unique<Connection>(fleet().gateway_port(), Connection::Kind::kTls));
  }
  for (size_t k = 0; k < sizeof(kPreface) - 2; ++k) {
    for (const auto& connection : slow) connection->Send(std::string(1, kPreface[k]));
    absl::SleepFor(absl::Milliseconds(50));
  }
  ExpectServing("200 silent connections and 200 slow ones");
  EXPECT_TRUE(Await([&] {
    return std::none_of(slow.begin(), slow.end(),
                        [](const auto& connection) { return connection->IsOpen(); });
  })) << "they had five seconds to say something";
}

TEST_F(AbuseOfGateway, SurvivesStreamsThatAreResetAtOnce) {
  const auto connection = Open();
  uint32_t stream = 1;
  for (; stream < 40'000; stream += 2) {
    if (!connection->Send(Frame(kHeaders, kEndHeaders, stream, CallHeaders()) +
                          Frame(kReset, kNone, stream, std::string("\0\0\0\x08", 4)))) {
      break;
    }
  }
  std::cout << stream / 2 << " resets were taken\n";
  ExpectServing("rapid reset");
}

TEST_F(AbuseOfGateway, SurvivesEndlessHeaders) {
  const auto connection = Open();
  std::string block;
  while (block.size() < 16'000) {
    block += Header(absl::StrCat("x-", block.size()), std::string(120, 'x'));
  }
  bool open = connection->Send(Frame(kHeaders, kNone, 1, CallHeaders()));
  int i = 0;
  for (; open && i < 4000; ++i) open = connection->Send(Frame(kContinuation, kNone, 1, block));
  EXPECT_FALSE(connection->IsOpen()) << "64 MB of headers were taken";
  ExpectServing("headers without end");
}

TEST_F(AbuseOfGateway, SurvivesEndlessPingsAndSettings) {
  for (const bool ping : {true, false}) {
    const auto connection = Open();
    const std::string frame =
        ping ? Frame(kPing, kNone, 0, "12345678") : Frame(kSettings, kNone, 0, "");
    std::string many;
    for (int i = 0; i < 1000; ++i) many += frame;
    for (int i = 0; i < 100 && connection->Send(many); ++i) {
    }
    ExpectServing(ping ? "100,000 pings" : "100,000 settings");
  }
}

TEST_F(AbuseOfGateway, SurvivesBytesThatAreNotHttp) {
  for (const std::string& bytes :
       {std::string("GET / HTTP/1.1\r\nHost: a\r\n\r\n"), std::string(100'000, '\xff'),
        std::string(kPreface) + std::string(100'000, '\xff'),
        std::string(kPreface) + std::string(100'000, '\0')}) {
    Connection(fleet().gateway_port()).Send(bytes);
    Connection(fleet().gateway_port(), Connection::Kind::kTls).Send(bytes);
  }
  ExpectServing("garbage");
}

// 100 calls whose message never comes. They do not reach the server.
TEST_F(AbuseOfGateway, AnswersCallsThatNeverEnd) {
  const size_t before = fleet().LogSize();
  const auto connection = Open();
  const std::string headers =
      CallHeaders() + Header("authorization", "Bearer pk_" + std::string(43, 'a'));
  for (uint32_t stream = 1; stream < 200; stream += 2) {
    connection->Send(Frame(kHeaders, kEndHeaders, stream, headers));
  }
  ExpectServing("100 calls without a message");
  EXPECT_TRUE(Await([&] {
    int num_answered = 0;
    for (const nlohmann::json& line : fleet().ReadLog(before)) {
      num_answered += line["code"] == "4" && line["server"] == "<NOSRV>" ? 1 : 0;
    }
    return num_answered == 100;
  }));
}

}  // namespace
}  // namespace pepeseg::testing
