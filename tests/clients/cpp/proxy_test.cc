#include "clients/cpp/proxy.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <ifaddrs.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "clients/cpp/answer_status.h"
#include "clients/cpp/channel.h"
#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::client {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr const char* kVariables[] = {"grpc_proxy", "https_proxy", "http_proxy", "no_grpc_proxy",
                                      "no_proxy"};
// Of TEST-NET-3, which no machine has.
constexpr char kRemote[] = "203.0.113.5:50051";

class ProxyTest : public ::testing::Test {
 protected:
  ProxyTest() { Clear(); }
  ~ProxyTest() override { Clear(); }

 private:
  static void Clear() {
    unsetenv("PEPESEG_KEY");
    for (const char* variable : kVariables) unsetenv(variable);
  }
};

// A proxy on this machine that answers each CONNECT with `answer` and hangs up.
class FakeProxy {
 public:
  explicit FakeProxy(std::string answer) : answer_(std::move(answer)) {
    listener_ = socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in name = {};
    name.sin_family = AF_INET;
    name.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(name);
    auto* address = reinterpret_cast<sockaddr*>(&name);
    EXPECT_EQ(bind(listener_, address, size), 0);
    EXPECT_EQ(listen(listener_, 16), 0);
    EXPECT_EQ(getsockname(listener_, address, &size), 0);
    address_ = "127.0.0.1:" + std::to_string(ntohs(name.sin_port));
    thread_ = std::thread([this] { Run(); });
  }
  ~FakeProxy() {
    shutdown(listener_, SHUT_RDWR);  // ends accept()
    thread_.join();
    close(listener_);
  }
  const std::string& address() const { return address_; }
  int connections() const { return connections_; }

 private:
  void Run() {
    while (true) {
      const int file = accept(listener_, nullptr, nullptr);
      if (file < 0) return;
      ++connections_;
      char request[4096];
      if (recv(file, request, sizeof(request), 0) > 0) {
        send(file, answer_.data(), answer_.size(), MSG_NOSIGNAL);
      }
      close(file);
    }
  }

  const std::string answer_;
  int listener_ = -1;
  std::string address_;
  std::atomic<int> connections_ = 0;
  std::thread thread_;
};

absl::Status List(const std::string& target) {
  const auto channel = OpenChannel(target, {});
  if (!channel.ok()) return channel.status();
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  v1::ListScenesResponse response;
  return FromGrpc(v1::SceneService::NewStub(*channel)->ListScenes(&context, {}, &response));
}

TEST_F(ProxyTest, IsTheOneOfTheFirstVariable) {
  EXPECT_FALSE(ProxyOf(kRemote));
  setenv("http_proxy", "http://me:secret@proxy.lab:3128/", 1);
  ASSERT_TRUE(ProxyOf(kRemote));
  EXPECT_EQ(ProxyOf(kRemote)->address, "proxy.lab:3128");
  EXPECT_EQ(ProxyOf(kRemote)->variable, "http_proxy");
  setenv("https_proxy", "http://second:1", 1);
  EXPECT_EQ(ProxyOf(kRemote)->variable, "https_proxy");
  setenv("grpc_proxy", "http://[::1]:8", 1);
  EXPECT_EQ(ProxyOf(kRemote)->address, "[::1]:8");
  setenv("grpc_proxy", "", 1);
  EXPECT_FALSE(ProxyOf(kRemote)) << "empty: no proxy";
  setenv("grpc_proxy", "https://second:1", 1);
  EXPECT_FALSE(ProxyOf(kRemote)) << "gRPC speaks to no proxy over TLS";
}

TEST_F(ProxyTest, IsNotForHostsOfNoProxy) {
  setenv("http_proxy", "http://proxy.lab:3128", 1);
  const auto used = [](const char* list, const char* target) {
    setenv("no_proxy", list, 1);
    return ProxyOf(target).has_value();
  };
  EXPECT_FALSE(used("10.0.0.0/8", "10.200.3.4:1"));
  EXPECT_TRUE(used("10.0.0.0/8", "11.0.0.1:1"));
  EXPECT_FALSE(used("a.org, 192.168.16.0/20", "192.168.31.255:1"));
  EXPECT_TRUE(used("192.168.16.0/20", "192.168.32.0:1"));
  EXPECT_FALSE(used("2001:db8::/33", "[2001:db8:7fff::1]:1"));
  EXPECT_TRUE(used("2001:db8::/33", "[2001:db8:8000::1]:1"));
  EXPECT_TRUE(used("10.0.0.0/40,10.0.0.0/x,/8", "10.0.0.1:1"));
  EXPECT_FALSE(used(".lab.ORG", "gpu.lab.org:1"));
  EXPECT_TRUE(used(".lab.org", "gpu.lab.com:1"));
  EXPECT_FALSE(used("*", kRemote));
  EXPECT_TRUE(used(",,", kRemote));
  setenv("no_grpc_proxy", "other.org", 1);
  EXPECT_TRUE(used("*", kRemote)) << "no_grpc_proxy overrides no_proxy";
}

// Addresses of this machine's interfaces, as hosts of a target.
std::vector<std::string> OwnHosts() {
  std::vector<std::string> hosts = {"127.0.0.1", "127.0.0.2", "localhost", "[::1]"};
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return hosts;
  for (const ifaddrs* one = all; one != nullptr; one = one->ifa_next) {
    if (one->ifa_addr == nullptr) continue;
    char text[INET6_ADDRSTRLEN];
    if (one->ifa_addr->sa_family == AF_INET) {
      const auto* address = reinterpret_cast<const sockaddr_in*>(one->ifa_addr);
      hosts.push_back(inet_ntop(AF_INET, &address->sin_addr, text, sizeof(text)));
    } else if (one->ifa_addr->sa_family == AF_INET6) {
      const auto* address = reinterpret_cast<const sockaddr_in6*>(one->ifa_addr);
      if (IN6_IS_ADDR_LINKLOCAL(&address->sin6_addr)) continue;  // needs the name of its interface
      hosts.push_back(
          "[" + std::string(inet_ntop(AF_INET6, &address->sin6_addr, text, sizeof(text))) + "]");
    }
  }
  freeifaddrs(all);
  return hosts;
}

TEST_F(ProxyTest, IsNeverForThisMachine) {
  const FakeProxy proxy("HTTP/1.1 403 Forbidden\r\n\r\n");
  setenv("http_proxy", ("http://" + proxy.address()).c_str(), 1);
  char name[256] = {};
  ASSERT_EQ(gethostname(name, sizeof(name) - 1), 0);
  EXPECT_FALSE(ProxyOf(std::string(name) + ":50051"));
  EXPECT_FALSE(ProxyOf("unix:/run/pepeseg"));
  for (const std::string& host : OwnHosts()) {
    const std::string target = host + ":1";  // no server listens there
    EXPECT_FALSE(ProxyOf(target)) << target;
    EXPECT_FALSE(ProxyOf("dns:///" + target)) << target;
    EXPECT_THAT(std::string(List(target).message()), Not(HasSubstr("proxy"))) << target;
  }
  EXPECT_EQ(proxy.connections(), 0);
  EXPECT_FALSE(List(kRemote).ok());
  EXPECT_GE(proxy.connections(), 1) << "other machines are reached through the proxy";
}

TEST_F(ProxyTest, IsNamedWhenItRefuses) {
  for (const int http : {403, 407, 502}) {
    const FakeProxy proxy("HTTP/1.1 " + std::to_string(http) + " No\r\n\r\n");
    for (const char* variable : {"http_proxy", "https_proxy", "grpc_proxy"}) {
      setenv(variable, ("http://me:secret@" + proxy.address()).c_str(), 1);
      const absl::Status status = List(kRemote);
      EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
      EXPECT_EQ(status.message(), "the proxy " + proxy.address() + ", which " + variable +
                                      " names, refused the connection to " + kRemote +
                                      " with HTTP " + std::to_string(http) +
                                      "; to connect without it, add 203.0.113.5 to no_proxy");
      EXPECT_TRUE(IsProxyFailure(std::string(status.message())));
      unsetenv(variable);
    }
  }
}

TEST_F(ProxyTest, IsNamedWhenItCannotBeReached) {
  setenv("http_proxy", "http://127.0.0.1:1", 1);
  EXPECT_THAT(
      std::string(List("example.org:50051").message()),
      AllOf(StartsWith("the proxy 127.0.0.1:1, which http_proxy names, cannot be reached: "),
            HasSubstr("Connection refused"), HasSubstr("example.org to no_proxy")));
  setenv("http_proxy", "http://nosuch.invalid:3128", 1);
  EXPECT_THAT(std::string(List(kRemote).message()),
              AllOf(HasSubstr("the proxy nosuch.invalid:3128, which http_proxy names, cannot be"),
                    HasSubstr("could not be resolved")));
}

TEST_F(ProxyTest, IsNamedWhenItSpeaksNoHttp) {
  const FakeProxy proxy("junk\r\n\r\n");
  setenv("http_proxy", ("http://" + proxy.address()).c_str(), 1);
  EXPECT_THAT(std::string(List(kRemote).message()),
              AllOf(HasSubstr("the proxy " + proxy.address() + ", which http_proxy names, did not"),
                    HasSubstr(kRemote)));
}

TEST_F(ProxyTest, LeavesErrorsOfTheServerAlone) {
  EXPECT_EQ(ExplainProxyFailure({"p:1", "http_proxy"}, kRemote, "too many calls wait"), "");
  EXPECT_FALSE(IsProxyFailure("the proxy of the gateway is busy"));
}

}  // namespace
}  // namespace pepeseg::client
