#include "server/rpc/listening_sockets.h"

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <string>

#include "absl/strings/str_cat.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

bool CanConnect(const sockaddr* address, socklen_t size) {
  const int client = socket(address->sa_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const bool connected = client >= 0 && connect(client, address, size) == 0;
  close(client);
  return connected;
}

bool CanConnectTo(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return CanConnect(reinterpret_cast<sockaddr*>(&address), sizeof(address));
}

TEST(ListeningSockets, TakeAFreePortOfTheirHost) {
  for (const char* address : {"127.0.0.1:0", "localhost:0", "0.0.0.0:0"}) {
    auto sockets = ListeningSockets::Open(address);
    ASSERT_OK(sockets) << address;
    ASSERT_FALSE(sockets->descriptors().empty());
    EXPECT_GT(sockets->port(), 0);
    EXPECT_TRUE(CanConnectTo(sockets->port())) << address;
    const int port = sockets->port();
    sockets->Close();
    EXPECT_FALSE(CanConnectTo(port)) << address;
  }
}

TEST(ListeningSockets, RefuseAPortThatIsTaken) {
  const auto first = ListeningSockets::Open("127.0.0.1:0");
  ASSERT_OK(first);
  const std::string address = absl::StrCat("127.0.0.1:", first->port());
  const auto second = ListeningSockets::Open(address);
  EXPECT_EQ(second.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(second.status().message(),
            absl::StrCat("cannot listen on ", address, ": Address already in use"));
}

TEST(ListeningSockets, RefuseMalformedAddresses) {
  for (const char* address :
       {"", "127.0.0.1", "127.0.0.1:", ":1", "127.0.0.1:70000", "127.0.0.1:http", "unix:"}) {
    EXPECT_EQ(ListeningSockets::Open(address).status().code(), absl::StatusCode::kInvalidArgument)
        << address;
  }
  EXPECT_FALSE(ListeningSockets::Open("unix:" + std::string(200, 'x')).ok());
  // An address of TEST-NET-1, which no machine has.
  EXPECT_EQ(ListeningSockets::Open("192.0.2.1:0").status().code(), absl::StatusCode::kUnavailable);
}

TEST(ListeningSockets, ReplaceAnEarlierUnixSocketAndRemoveTheirOwn) {
  const testing::TempFolder folder;
  const std::string path = (folder / "socket").string();
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
  // A socket as a killed server leaves it: bound, but no process listens.
  const int left = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  ASSERT_EQ(bind(left, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  close(left);
  {
    const auto sockets = ListeningSockets::Open("unix:" + path);
    ASSERT_OK(sockets);
    EXPECT_EQ(sockets->port(), 0);
    EXPECT_TRUE(CanConnect(reinterpret_cast<sockaddr*>(&address), sizeof(address)));
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace pepeseg
