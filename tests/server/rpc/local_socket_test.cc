#include "server/rpc/local_socket.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <fstream>

#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

class LocalSocketTest : public ::testing::Test {
 protected:
  // Returns what a client reads: the byte that each connection gets, or "" if it was refused.
  std::string Call() const {
    const int end = socket(AF_UNIX, SOCK_STREAM, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path_.string().copy(address.sun_path, sizeof(address.sun_path) - 1);
    char byte = 0;
    const bool connected =
        connect(end, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
    const std::string said = !connected ? "no connection" : read(end, &byte, 1) == 1 ? "x" : "";
    close(end);
    return said;
  }
  static void Greet(int connection) {
    EXPECT_EQ(write(connection, "x", 1), 1);
    close(connection);
  }

  testing::TempFolder folder_;
  const fs::path path_ = folder_ / "admin";
};

TEST_F(LocalSocketTest, AcceptsOnlyItsUser) {
  ASSERT_OK_AND_ASSIGN(const auto listener, LocalSocket::Listen(path_));
  struct stat what {};
  ASSERT_EQ(stat(path_.c_str(), &what), 0);
  EXPECT_EQ(what.st_mode & 07777, 0600u);
  listener->Serve(Greet);
  EXPECT_EQ(Call(), "x");
  listener->Stop();
  EXPECT_FALSE(fs::exists(path_));
}

TEST_F(LocalSocketTest, RefusesOtherUsersWhateverTheMode) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root, to be another user";
  ASSERT_OK_AND_ASSIGN(const auto listener, LocalSocket::Listen(path_));
  listener->Serve(Greet);
  fs::permissions(folder_.path(), fs::perms::all);
  fs::permissions(path_, fs::perms::all);
  const pid_t pid = fork();
  if (pid == 0) _exit(setuid(65534) != 0 ? 2 : Call() == "" ? 0 : 1);
  int status = 0;
  ASSERT_EQ(waitpid(pid, &status, 0), pid);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(Call(), "x");
}

TEST_F(LocalSocketTest, RefusesAFolderThatOthersMayWrite) {
  fs::permissions(folder_.path(), fs::perms::all);
  EXPECT_STATUS(LocalSocket::Listen(path_), absl::StatusCode::kFailedPrecondition,
                "everybody may write");
}

TEST_F(LocalSocketTest, CreatesItsFolder) {
  EXPECT_OK(LocalSocket::Listen(folder_ / "made/admin").status());
  struct stat what {};
  ASSERT_EQ(stat((folder_ / "made").c_str(), &what), 0);
  EXPECT_EQ(what.st_mode & 07777, 0700u);
}

TEST_F(LocalSocketTest, ReplacesOnlyADeadSocket) {
  {
    ASSERT_OK_AND_ASSIGN(const auto first, LocalSocket::Listen(path_));
    EXPECT_TRUE(absl::IsUnavailable(LocalSocket::Listen(path_).status()));
    fs::rename(path_, folder_ / "kept");  // as of a process that was killed
  }
  fs::rename(folder_ / "kept", path_);
  EXPECT_OK(LocalSocket::Listen(path_).status());
  std::ofstream(path_) << "a file";
  EXPECT_TRUE(absl::IsUnavailable(LocalSocket::Listen(path_).status()));
  EXPECT_TRUE(fs::is_regular_file(path_));
}

}  // namespace
}  // namespace pepeseg
