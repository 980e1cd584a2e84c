// Sends bytes that no gRPC client sends to the server program's port. The server stays alive,
// answers other clients meanwhile, and its memory stays bounded.
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <cstdint>
#include <fstream>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/server/pepesegd_process.h"
#include "tests/server/service_client.h"
#include "tests/system/stress/http2_connection.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/time_limit.h"

namespace pepeseg {
namespace {

using http2::CallHeaders, http2::Connection, http2::Frame, http2::Header, http2::kPreface;
using enum http2::FrameType;
using enum http2::Flags;

class Http2AbuseTest : public ::testing::Test {
 protected:
  Http2AbuseTest() : server_(folder_ / "data"), client_(server_.channel()) {
    std::ifstream(absl::StrCat((folder_ / "data").string(), ".port")) >> port_;
    EXPECT_OK(client_.CreateScene("a"));
    rss_before_ = Rss();
  }

  int64_t Rss() const {
    int64_t pages = 0;
    std::ifstream(absl::StrCat("/proc/", server_.pid(), "/statm")) >> pages >> pages;
    return pages * sysconf(_SC_PAGESIZE);
  }

  // Checks that other clients are served meanwhile, and prints the cost. most: bytes by which the
  // server's memory may have grown.
  void ExpectServing(const char* what, int64_t most = int64_t{192} << 20) {
    const absl::Time start = absl::Now();
    EXPECT_TRUE(absl::IsNotFound(client_.GetJob("jobs/j1").status()));
    const absl::Duration took = absl::Now() - start;
    std::cout << what << ": answered in " << absl::FormatDuration(took) << ", RSS "
              << (rss_before_ >> 20) << " -> " << (Rss() >> 20) << " MiB\n";
    EXPECT_TRUE(server_.alive());
    EXPECT_LT(took, testing::TimeLimit(absl::Seconds(2)));
    EXPECT_LT(Rss() - rss_before_, most);
  }

  const testing::TempFolder folder_;
  testing::PepesegdProcess server_;
  testing::ServiceClient client_;
  int port_ = 0;
  int64_t rss_before_ = 0;
};

TEST_F(Http2AbuseTest, SurvivesConnectionsThatSendAByteAtATime) {
  std::vector<std::unique_ptr<Connection>> connections;
  for (int i = 0; i < 400; ++i) connections.push_back(std::make_unique<Connection>(port_));
  for (size_t k = 0; k < sizeof(kPreface) - 2; ++k) {
    for (const auto& connection : connections) connection->Send(std::string(1, kPreface[k]));
    absl::SleepFor(absl::Milliseconds(50));
  }
  ExpectServing("400 slow connections");
}

// Debian's gRPC does not limit calls that are reset; only the speed of answering bounds their
// number (README.md: use a gateway). On an idle machine the server grows by 75 MiB, on one that
// lets all 20,000 calls wait by 450 MiB.
TEST_F(Http2AbuseTest, SurvivesStreamsThatAreResetAtOnce) {
  Connection connection(port_);
  connection.Send(std::string(kPreface) + Frame(kSettings, kNone, 0, ""));
  uint32_t stream = 1;
  for (; stream < 40'000; stream += 2) {
    if (!connection.Send(Frame(kHeaders, kEndHeaders, stream, CallHeaders()) +
                         Frame(kReset, kNone, stream, std::string("\0\0\0\x08", 4)))) {
      break;
    }
  }
  std::cout << stream / 2 << " resets were taken\n";
  ExpectServing("rapid reset", int64_t{1} << 30);
}

TEST_F(Http2AbuseTest, SurvivesEndlessHeaders) {
  Connection connection(port_);
  connection.Send(std::string(kPreface) + Frame(kSettings, kNone, 0, ""));
  std::string block;
  while (block.size() < 16'000)
    block += Header(absl::StrCat("x-", block.size()), std::string(120, 'x'));
  bool open = connection.Send(Frame(kHeaders, kNone, 1, CallHeaders()));
  for (int i = 0; open && i < 4000; ++i)
    open = connection.Send(Frame(kContinuation, kNone, 1, block));
  ExpectServing("64 MB of headers");
}

TEST_F(Http2AbuseTest, SurvivesEndlessPingsAndSettings) {
  for (const bool ping : {true, false}) {
    Connection connection(port_);
    connection.Send(std::string(kPreface) + Frame(kSettings, kNone, 0, ""));
    const std::string frame =
        ping ? Frame(kPing, kNone, 0, "12345678") : Frame(kSettings, kNone, 0, "");
    std::string many;
    for (int i = 0; i < 1000; ++i) many += frame;
    for (int i = 0; i < 100 && connection.Send(many); ++i) {
    }
    ExpectServing(ping ? "100,000 pings" : "100,000 settings");
  }
}

TEST_F(Http2AbuseTest, SurvivesBytesThatAreNotHttp) {
  for (const std::string& bytes :
       {std::string("GET / HTTP/1.1\r\nHost: a\r\n\r\n"), std::string(100'000, '\xff'),
        std::string(kPreface) + std::string(100'000, '\xff'),
        std::string(kPreface) + std::string(100'000, '\0')}) {
    Connection(port_).Send(bytes);
  }
  ExpectServing("garbage");
}

}  // namespace
}  // namespace pepeseg
