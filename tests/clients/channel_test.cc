#include "clients/cli/channel.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace pepeseg::cli {
namespace {

struct ChannelTest : ::testing::Test {
  ChannelTest() {
    unsetenv("PEPESEG_KEY");
    std::ofstream(file) << "pk_secret\nand a remark\n";
  }
  ~ChannelTest() override {
    unsetenv("PEPESEG_KEY");
    std::filesystem::remove(file);
  }
  const std::filesystem::path file =
      std::filesystem::path(::testing::TempDir()) / "pepeseg_channel_test_key";
};

TEST_F(ChannelTest, SendsNoKeyUnencryptedToAnotherMachine) {
  Login login;
  login.key_file = file;
  for (const char* here : {"127.0.0.1:1", "localhost:1", "[::1]:1", "unix:/tmp/x"}) {
    EXPECT_TRUE(OpenChannel(here, login).ok()) << here;
  }
  for (const char* beyond : {"10.0.0.1:1", "example.org:1", "127.0.0.1.example.org:1",
                             "localhost.example.org:1", "dns:///127.0.0.1:1"}) {
    const auto refused = OpenChannel(beyond, login);
    EXPECT_EQ(refused.status().code(), absl::StatusCode::kInvalidArgument) << beyond;
    EXPECT_NE(refused.status().message().find("not encrypted"), std::string::npos);
    EXPECT_EQ(refused.status().message().find("pk_secret"), std::string::npos);
    EXPECT_TRUE(OpenChannel(beyond, {}).ok()) << "no key, nothing to hide";
    EXPECT_TRUE(OpenChannel(std::string("https://") + beyond, login).ok()) << beyond;
    Login encrypted = login;
    encrypted.tls = true;
    EXPECT_TRUE(OpenChannel(beyond, encrypted).ok()) << beyond;
  }
}

TEST_F(ChannelTest, TakesAKeyFromTheEnvironment) {
  setenv("PEPESEG_KEY", "pk_secret", 1);
  EXPECT_FALSE(OpenChannel("example.org:1", {}).ok());
  setenv("PEPESEG_KEY", "", 1);
  EXPECT_TRUE(OpenChannel("example.org:1", {}).ok());
  setenv("PEPESEG_KEY", "no key", 1);
  EXPECT_FALSE(OpenChannel("127.0.0.1:1", {}).ok());
  Login login;
  login.key_file = file;  // counts before it
  EXPECT_TRUE(OpenChannel("127.0.0.1:1", login).ok());
}

TEST_F(ChannelTest, NamesTheFileThatIsWrong) {
  Login login;
  login.key_file = file.string() + ".none";
  EXPECT_NE(OpenChannel("127.0.0.1:1", login).status().message().find(".none"), std::string::npos);
  std::ofstream(file) << "";
  login.key_file = file;
  EXPECT_NE(OpenChannel("127.0.0.1:1", login).status().message().find("holds no key"),
            std::string::npos);
  Login half;
  half.certificate = file;
  EXPECT_NE(OpenChannel("127.0.0.1:1", half).status().message().find("together"),
            std::string::npos);
  Login ca;
  ca.ca = file.string() + ".none";
  EXPECT_FALSE(OpenChannel("127.0.0.1:1", ca).ok());
}

}  // namespace
}  // namespace pepeseg::cli
